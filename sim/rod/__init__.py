"""One Cosserat rod: elastic, or with the muscles of an arm. Imports all of `sim` but `assembly`."""
