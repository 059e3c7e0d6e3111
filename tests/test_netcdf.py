"""Runs as NetCDF4: the same run again, and arrays that others can read, with units."""

import subprocess
import sys

import h5netcdf
import numpy as np
import pytest
import xarray
from conftest import coil_execution
from test_store import same

import octoctrl as oc
from octoctrl.carrying.execution import execute, resume
from octoctrl.files import netcdf, store
from octoctrl.sim.errors import OctoctrlError


@pytest.fixture(scope="module")
def written(tmp_path_factory, coil_run):
    return store.save(tmp_path_factory.mktemp("nc") / "run.nc", coil_run, origin={"configuration": "text"})


def test_a_run_comes_back_to_the_last_bit(written, tmp_path, coil_run):
    assert same(oc.load(written), coil_run)
    header = store.read_header(written)
    assert header["content"] == "Execution" and header["origin"] == {"configuration": "text"} and header["schema"] == store.SCHEMA
    again = store.save(tmp_path / "run.npz", oc.load(written))
    assert same(oc.load(again), coil_run)


def test_others_read_names_units_and_coordinates(written, coil_run):
    with xarray.open_dataset(written, engine="h5netcdf") as found:
        assert np.array_equal(found.position, coil_run.recording.points) and found.position.dims == ("time", "node", "axis")
        assert found.position.units == "m" and found.time.units == "s" and found.time.dtype == np.float64
        index = coil_run.plan.arm.layout.index("R-OM")
        assert np.array_equal(found.activation.sel(muscle=b"R-OM"), coil_run.recording.levels[:, index])
        assert found.lifted_writhe.units == "turns" and np.array_equal(found.planned_twist, coil_run.planned.twist)
        assert found.s_node.values == pytest.approx(coil_run.plan.arm.edges, rel=1e-12) and found.attrs["Conventions"] == "CF-1.11"
        assert found.attrs["status"] == "finished" and found.attrs["schema"] == store.SCHEMA
        assert all("long_name" in variable.attrs for variable in found.data_vars.values() if variable.name != "header")
    with xarray.open_dataset(written, engine="h5netcdf", group="plan") as planned:
        assert np.array_equal(planned.strains, coil_run.plan.strains) and np.array_equal(planned.twist, coil_run.plan.trace.twist)
    with h5netcdf.File(written, "r") as file:
        assert file["position"].chunks == (64, 49, 3) and file["position"].dtype == np.float64


def test_it_is_smaller_than_the_archive(written, tmp_path, coil_run):
    archive = store.save(tmp_path / "run.npz", coil_run)
    assert written.stat().st_size < 0.8 * archive.stat().st_size


def test_datasets_in_hand(coil_run):
    found = coil_run.to_xarray()
    assert float(found.position.sel(axis=b"z").isel(time=-1, node=-1)) == coil_run.recording.points[-1, -1, 2]
    assert float(found.twist.interp(time=0.6)) == pytest.approx(np.interp(0.6, coil_run.trace.time, coil_run.trace.twist))
    assert found.twist.to_dataframe().shape[0] == len(coil_run.trace.time)


def test_a_run_is_kept_in_parts_and_goes_on(tmp_path, coil_plan):
    from test_parts import broken_off

    path = tmp_path / "run.nc"
    broken_off(coil_plan, path, 1, feedback="open-loop")
    assert not oc.load(path).recording.complete
    assert resume(path).recording == oc.load(path).recording == execute(coil_plan, feedback="open-loop").recording
    assert [item.name for item in tmp_path.iterdir()] == ["run.nc"]


def test_one_wrong_byte_is_seen_before_hdf5_reads_it(written, tmp_path):
    """HDF5 hangs on some of them."""
    whole, path = bytearray(written.read_bytes()), tmp_path / "run.nc"
    for place in (0, 9, 3000, len(whole) // 2, len(whole) - 40, len(whole) - 1):
        whole[place] ^= 1
        path.write_bytes(whole)
        assert netcdf.read(path) is None
        whole[place] ^= 1
    path.write_bytes(whole)
    assert netcdf.read(path) is not None


def test_only_runs(tmp_path, coil_plan):
    with pytest.raises(OctoctrlError, match=r"unknown format '.nc'; use .npz"):
        oc.save(tmp_path / "plan.nc", coil_plan)
    with pytest.raises(OctoctrlError, match=r"unknown format '.h5'; use .npz or .nc"):
        oc.save(tmp_path / "run.h5", coil_execution(coil_plan, until=0.1))


def test_damaged_files_are_called_so(written, tmp_path):
    whole = written.read_bytes()
    path = tmp_path / "run.nc"
    for content in (b"", b"\x89HDF\r\n\x1a\n", whole[: len(whole) // 2], whole[:3000] + bytes(3000) + whole[6000:], b"CDF\x01" + bytes(99)):
        path.write_bytes(content)
        with pytest.raises(OctoctrlError, match=r"run.nc is not a file of octoctrl, or is damaged"):
            oc.load(path)
    xarray.Dataset({"a": ("x", np.arange(3.0))}).to_netcdf(path, engine="h5netcdf")
    with pytest.raises(OctoctrlError, match=r"run.nc is not a file of octoctrl, or is damaged"):
        oc.load(path)
    with pytest.raises(OctoctrlError, match=r"none.nc does not exist"):
        oc.load(tmp_path / "none.nc")


def test_what_claims_to_be_huge_is_not_read(tmp_path, written, monkeypatch):
    monkeypatch.setattr("octoctrl.sim.archives.ALLOWANCE", 1000)
    monkeypatch.setattr("octoctrl.sim.archives.SWELLING", 1)
    assert netcdf.read(written) is None


def test_a_missing_extra_says_its_command(tmp_path):
    program = """
import sys
sys.modules["h5netcdf"] = None
from octoctrl.cli.application import main
sys.exit(main(["verify", "run.nc"]))
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr == "octoctrl: this needs h5netcdf, which is not installed: pip install 'octoctrl[io]'\n"
