"""The arm: geometry and masses of the source study, grading, and messages."""

import dataclasses

import numpy as np
import pytest

from octoctrl.sim.body.arm import (
    LONGITUDINAL_GROUPS,
    MUSCLE_GROUPS,
    REST_FRAME,
    Arm,
    LumpedSection,
    azimuth,
    material_direction,
    oblique_angle,
)
from octoctrl.sim.errors import OctoctrlError

ARM = Arm.octopus()


def test_base_section():
    base = ARM.section(np.array([0.0]))
    assert base.cord_radius[0] == pytest.approx(4.6810995e-3, rel=1e-7)
    assert base.muscle_radius[0] == pytest.approx(2.9018810e-3, rel=1e-7)
    assert base.muscle_offset[0] == pytest.approx(7.582981e-3, rel=1e-6)
    assert base.oblique_offset[0] == pytest.approx(12.68965e-3, rel=5e-3)
    assert base.outer_radius[0] == pytest.approx(13.822e-3, rel=5e-3)
    # Touching circles, and the share of the nominal disc that they fill.
    assert base.muscle_radius == pytest.approx(base.muscle_offset * np.sin(np.pi / 8))
    assert base.cord_radius**2 + 8 * base.muscle_radius**2 == pytest.approx(0.62 * 0.012**2)


def test_taper():
    section = ARM.section(np.array([0.0, 0.1, 0.2]))
    assert section.cord_radius * 1e3 == pytest.approx([4.681100, (4.681100 + 0.390092) / 2, 0.390092], rel=1e-5)
    assert section.fibre_radius * 1e3 == pytest.approx([1.132295, 0.613327, 0.094358], rel=1e-5)
    # The assembly's longitudinal muscles are a little thicker towards the tip (0.261 mm), where straight lines make them touch the cord.
    assert section.ring_offset[[0, 2]] * 1e3 == pytest.approx([11.0018, 1.467911], abs=0.04)


def test_masses_are_those_of_the_assembly():
    s = (np.arange(20000) + 0.5) / 20000 * ARM.length
    grams = 1e3 * ARM.length * np.mean(np.array(ARM.section(s).masses), axis=1)
    for mass, expected in zip(grams, (5.2652, 19.3463, 5.8634, 7.2505), strict=True):
        assert mass == pytest.approx(expected, rel=3e-3)
    assert grams.sum() == pytest.approx(37.7254, rel=3e-3)


def test_stiffness_at_the_base():
    base = ARM.section(np.array([0.0]))
    assert base.bending_stiffness[0] == pytest.approx(3.73289e-6 + 8 * 5.36796e-7, rel=0.03)
    assert Arm.octopus(lumped=LumpedSection.published()).section(np.array([0.0])).twist_stiffness[0] / 3 == pytest.approx(
        4.97718e-6 + 8 * 7.15728e-7, rel=0.03
    )
    oblique = 8 * 0.0358028 / np.cos(np.radians(74.43))
    assert base.shear_stiffness[0] == pytest.approx(0.611918 + 8 * 0.232037 + oblique, rel=0.02)


def test_oblique_fibres_stand_at_74_degrees_at_the_base_and_31_at_the_tip():
    angles = [oblique_angle(ARM, share * ARM.length) for share in (0.0, 0.25, 0.5, 0.75, 1.0)]
    assert angles == pytest.approx([74.43, 70.6, 64.4, 53.1, 30.9], abs=0.5)
    assert angles[0] == pytest.approx(74.43, abs=0.05)
    s = (np.arange(5000) + 0.5) / 5000 * ARM.length
    assert ARM.length * np.mean(ARM.section(s).oblique_stretch) == pytest.approx(0.469918, rel=5e-3)


def test_azimuths_run_from_x_towards_z_in_the_material_frame():
    places = {"LM1": (1, 0, 0), "LM3": (0, 0, 1), "LM5": (-1, 0, 0), "LM7": (0, 0, -1)}
    for group, place in places.items():
        assert material_direction(azimuth(group)) @ REST_FRAME == pytest.approx(place, abs=1e-15)
    assert [azimuth(group) for group in LONGITUDINAL_GROUPS] == pytest.approx(np.arange(8) * np.pi / 4)
    assert MUSCLE_GROUPS == (*LONGITUDINAL_GROUPS, "R-OM", "L-OM", "TM")
    assert np.linalg.det(REST_FRAME) == pytest.approx(1.0)


@pytest.mark.parametrize("grading", [0.0, 0.3, 0.7, 1.0])
@pytest.mark.parametrize("elements", [8, 48, 200])
def test_elements_are_graded(grading, elements):
    arm = Arm.octopus(elements=elements, grading=grading)
    length = np.diff(arm.edges)
    assert arm.edges[0] == 0.0 and arm.edges[-1] == pytest.approx(arm.length, rel=1e-14) and len(length) == elements
    assert np.all(length > 0)
    if grading == 0.0:
        assert length == pytest.approx(arm.length / elements)
    else:
        assert np.all(np.diff(length) < 0)
        middle = (arm.edges[1:] + arm.edges[:-1]) / 2
        outline = arm.section(middle).outline
        # As long as the local radius to the power of the grading, to the curvature of the radius over one element.
        assert length / outline**grading == pytest.approx(np.mean(length / outline**grading), rel=10 / elements**2 + 1e-3)
    if grading == 1.0:
        assert length[:-1] / length[1:] == pytest.approx(arm.taper ** (1 / elements))


def test_a_cylinder_has_equal_elements():
    assert np.diff(Arm.octopus(taper=1.0).edges) == pytest.approx(0.2 / 48)


def test_fingerprint_tells_arms_apart_but_not_resolutions():
    same = (Arm.octopus(elements=60), Arm.octopus(grading=0.5), Arm.octopus(name="other"))
    assert {arm.fingerprint for arm in same} == {ARM.fingerprint}
    law = dataclasses.replace(ARM.longitudinal, maximum_stress=1e5)
    changed = (
        Arm.octopus(length=0.21), Arm.octopus(taper=11.0), Arm.octopus(longitudinal=law), Arm.octopus(oblique=law),
        Arm.octopus(lumped=LumpedSection(torsion=2.0)), Arm.octopus(densities=(1050.0, 1261.238, 858.4457, 1050.0)),
    )  # fmt: skip
    assert len({arm.fingerprint for arm in (ARM, *changed)}) == len(changed) + 1
    assert len(ARM.fingerprint) == 4 and int(ARM.fingerprint, 16) >= 0


@pytest.mark.parametrize("changes, message", [
    ({"length": 20.0}, r"length=20 m is outside 0.001…5 m; lengths are SI - did you mean 0.20 \(20 cm\)\?"),
    ({"length": "20cm"}, "length: expected a number in m, found the string '20cm'"),
    ({"length": float("nan")}, "length is nan; a finite number is needed"),
    ({"base_radius": 0.06}, "rod theory wants radius/length < 0.25, found 0.30"),
    ({"taper": 0.5}, "taper=0.5 is outside 1…50"),
    ({"elements": 4}, "elements=4: at least 8 are needed"),
    ({"elements": 48.0}, "elements: expected a whole number, found float 48.0"),
    ({"grading": 2.0}, "grading=2 is outside 0…1"),
    ({"youngs_modulus": 0.0}, r"youngs_modulus=0 Pa is outside 1…1e\+09 Pa; soft tissue has 1e3…1e6 Pa"),
    ({"densities": (1050.0, 1050.0, 1050.0)}, "four are needed"),
    ({"densities": (1050.0, -1.0, 1050.0, 1050.0)}, r"density=-1 kg/m\^3 is outside 1…30000 kg/m\^3"),
    ({"ring_radius": 0.02}, "ring_radius=0.02 m is outside 0…0.012 m; a layer is thinner than the arm"),
    ({"straight_fraction": 1.5}, "straight_fraction=1.5 is outside 0…1"),
    ({"oblique_pitch": 1e-5}, "oblique_pitch=1e-05 m is outside >= 0.0002 m; it is the length of one turn"),
    ({"lenght": 0.2}, "Arm has no field 'lenght'; did you mean 'length'"),
])  # fmt: skip
def test_bad_arms_are_refused_in_one_sentence(changes, message):
    with pytest.raises(OctoctrlError, match=message):
        Arm.octopus(**changes)


@pytest.mark.parametrize("changes", [{"hoop_ratio": 0.6}, {"oblique_passive": 0.0}, {"torsion": -1.0}, {"oblique_stress": 0.0}])
def test_bad_lumped_sections_are_refused(changes):
    with pytest.raises(OctoctrlError, match=next(iter(changes))):
        LumpedSection(**changes)


def test_numbers_of_numpy_and_whole_numbers_are_numbers():
    """Also in the fingerprint: an arm that is written otherwise is not another arm."""
    plain = Arm(length=1.0, base_radius=0.05, elements=48, taper=10.0)
    numpy = Arm(length=np.float64(1.0), base_radius=np.float64(0.05), elements=np.int64(48), taper=np.int32(10))
    assert numpy == plain and type(numpy.elements) is int
    assert numpy.fingerprint == plain.fingerprint == Arm(length=1, base_radius=0.05, taper=10).fingerprint
    assert Arm().fingerprint == "534e"
    assert (
        len(
            {
                Arm.octopus(lumped=lumped).fingerprint
                for lumped in (LumpedSection(), LumpedSection(oblique_stress=0.5), LumpedSection.published())
            }
        )
        == 3
    )
    assert len(numpy.edges) == 49
    for wrong in (np.float64(48.0), "48", None, True):
        with pytest.raises(OctoctrlError, match="elements: expected a whole number, found "):
            Arm(elements=wrong)
    with pytest.raises(OctoctrlError, match="length: expected a number in m, found bool True"):
        Arm(length=True)


def test_compliant_tissue_is_softer_in_tension_and_nothing_else():
    soft = Arm.octopus(tissue="compliant")
    for name in ("longitudinal", "oblique", "transverse"):
        mine, theirs = getattr(soft, name), getattr(ARM, name)
        stretches = np.linspace(0.7, 1.7, 41)
        wanted = theirs.passive_stress(stretches) * np.where(stretches > 1, 0.15, 1.0)
        np.testing.assert_allclose(mine.passive_stress(stretches), wanted, atol=1e-9)
        assert dataclasses.replace(mine, passive_scale=1.0) == theirs
    assert soft.fingerprint != ARM.fingerprint and soft.name == "octopus-20cm-compliant"
    assert Arm.octopus(tissue="compliant", length=0.3).length == 0.3
    assert Arm.octopus(tissue="study") == ARM
