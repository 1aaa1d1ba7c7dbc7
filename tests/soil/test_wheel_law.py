"""The forward law against closed forms, an independent integration, and laws of mechanics."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from lpet_sim.errors import SpecError
from lpet_sim.soil.load import load_soil
from lpet_sim.soil.spec import MechanicalSoilSpec, WheelSpec
from lpet_sim.soil.stress_kernels import SUMS, VERTICAL, forces_into, motion_of, shear_stress
from lpet_sim.soil.wheel_law import flank_coefficients, law_of, rolling_radius, wheel_forces

WHEEL = WheelSpec(radius_m=0.1425, width_m=0.12)
LOAD_N = 192.0
MARS_MPS2 = 3.71
SOILS = ("cmu_sand", "grc1_fitted", "lunar_simulant", "mars_regolith", "mars_sand")


def soil_of(name: str, **changed: object) -> MechanicalSoilSpec:
    """Load a soil that is known by its mechanics, with some values changed."""
    soil = load_soil(name)
    assert isinstance(soil, MechanicalSoilSpec)
    return MechanicalSoilSpec.model_validate({**soil.model_dump(), **changed})


def without_shear(exponent: float) -> MechanicalSoilSpec:
    """Give a soil that only presses, from right below the axle forwards."""
    return soil_of(
        "cmu_sand",
        pressure={"kind": "modulus", "k": 1e6},
        sinkage_exponent=exponent,
        cohesion_pa=0.0,
        friction_rad=1e-12,
        peak_angle=1e-9,
        peak_angle_slip=0.0,
        rear_angle=0.0,
        rear_angle_slip=0.0,
    )


@pytest.mark.parametrize("name", SOILS)
def test_the_soil_carries_the_load_to_a_billionth(name: str) -> None:
    """The sum of the vertical stresses is the load, driven and braked, straight and aslant."""
    slip, creep = (x.ravel() for x in np.meshgrid([-5.0, -0.3, 0.0, 0.2, 0.8], [0.0, 0.3]))
    out = np.empty((slip.size, SUMS + 1))
    forces_into(
        law_of(soil_of(name), WHEEL, MARS_MPS2), slip, creep, np.full(slip.size, LOAD_N), out
    )
    assert (out[:, SUMS] > 0).all()
    np.testing.assert_allclose(out[:, VERTICAL], LOAD_N, rtol=1e-9)


@pytest.mark.parametrize("exponent", [0.5, 1.0, 1.46])
def test_without_shear_the_wheel_is_held_back_by_bekkers_compaction(exponent: float) -> None:
    """Drawbar pull is minus ``b k z^(n+1) / (n+1)``, the work of a rut of depth z per length."""
    forces = wheel_forces(without_shear(exponent), WHEEL, 0.0, 0.0, [20.0, 192.0], MARS_MPS2)
    rut = WHEEL.width_m * 1e6 * forces.sinkage_m ** (exponent + 1) / (exponent + 1)
    np.testing.assert_allclose(forces.compaction_n, rut, rtol=2e-5)
    np.testing.assert_allclose(forces.drawbar_n, -forces.compaction_n, rtol=1e-8)
    np.testing.assert_allclose(forces.torque_nm, 0.0, atol=1e-8)


def test_a_shallow_wheel_sinks_as_bekker_says() -> None:
    """For n = 1 and little sinkage the load is ``(2/3) b k z sqrt(2 r z)``."""
    forces = wheel_forces(without_shear(1.0), WHEEL, 0.0, 0.0, [0.5, 1.0, 2.0], MARS_MPS2)
    z = forces.sinkage_m
    load = 2 / 3 * WHEEL.width_m * 1e6 * z * np.sqrt(2 * WHEEL.radius_m * z)
    np.testing.assert_allclose(load, [0.5, 1.0, 2.0], rtol=0.01)


def integrated(soil: MechanicalSoilSpec, slip: float, entry: float) -> tuple[float, float, float]:
    """Integrate Wong and Reece's stresses adaptively: load, drawbar pull, torque in driving."""
    r, b = WHEEL.radius_m, WHEEL.width_m
    peak = (soil.peak_angle + soil.peak_angle_slip * slip) * entry
    rear = (soil.rear_angle + soil.rear_angle_slip * slip) * entry
    n = soil.sinkage_exponent + soil.sinkage_exponent_slip * slip
    modulus = soil.cohesion_pa * soil.pressure.kc + (  # type: ignore[union-attr]
        soil.density_kgpm3 * MARS_MPS2 * b * soil.pressure.kphi  # type: ignore[union-attr]
    )

    def stresses(theta: float) -> tuple[float, float]:
        front = theta
        if theta < peak:
            front = entry - (theta - rear) / (peak - rear) * (entry - peak)
        sigma = modulus * (r / b * max(math.cos(front) - math.cos(entry), 0.0)) ** n
        moved = r * ((entry - theta) - (1 - slip) * (math.sin(entry) - math.sin(theta)))
        most = soil.cohesion_pa + sigma * math.tan(soil.friction_rad)
        return sigma, most * (1 - math.exp(-moved / soil.shear_modulus_x_m))

    def summed(weigh: object) -> float:
        return r * b * float(quad(weigh, rear, entry, points=[peak], epsabs=1e-10, limit=200)[0])

    def up(x: float) -> float:
        return stresses(x)[0] * math.cos(x) + stresses(x)[1] * math.sin(x)

    def ahead(x: float) -> float:
        return stresses(x)[1] * math.cos(x) - stresses(x)[0] * math.sin(x)

    return summed(up), summed(ahead), r * summed(lambda x: stresses(x)[1])


@pytest.mark.parametrize("slip", [0.0, 0.1, 0.5, 0.9])
def test_the_sums_are_those_of_an_adaptive_integration(slip: float) -> None:
    """An independent reading of the stresses, integrated by another method, gives the same."""
    soil = soil_of("mars_regolith")
    forces = wheel_forces(soil, WHEEL, slip, 0.0, LOAD_N, MARS_MPS2)
    load, drawbar, torque = integrated(soil, slip, float(forces.entry_angle_rad))
    assert load == pytest.approx(LOAD_N, rel=1e-6)
    assert drawbar == pytest.approx(float(forces.drawbar_n), abs=1e-6 * LOAD_N)
    assert torque == pytest.approx(float(forces.torque_nm), rel=1e-6)


def test_shear_stress_stays_within_mohr_and_coulomb() -> None:
    """In no direction, with unequal moduli, is it above ``c + sigma tan(phi)``; it comes close."""
    law = law_of(soil_of("lunar_simulant"), WHEEL, MARS_MPS2)
    most = 800.0 + 5000.0 * law.tan_phi
    shares = []
    for slip in (-20.0, -0.5, 0.0, 0.3, 1.0):
        for creep in (-3.0, 0.0, 0.05, 1.0):
            motion = motion_of(law, slip, creep)
            for theta in (-0.5, 0.0, 0.4, 0.79):
                shares.append(math.hypot(*shear_stress(law, motion, theta, 0.8, 5000.0)) / most)
    assert max(shares) <= 1.0 + 1e-12
    assert max(shares) > 0.99


@pytest.mark.parametrize("slip", [-1.0, -0.1, 0.0, 0.4])
def test_shear_displacement_follows_the_rim(slip: float) -> None:
    """Its derivative is the rim's speed against the soil, ``-r (1 - a cos)`` and ``-r creep``."""
    changed = {"shear_modulus_x_m": 1e5, "shear_modulus_y_m": 1e5, "cohesion_pa": 1e5}
    law = law_of(soil_of("mars_sand", **changed), WHEEL, MARS_MPS2)
    motion, step = motion_of(law, slip, 0.2), 1e-3
    for theta in (-0.2, 0.1, 0.6):
        near = [shear_stress(law, motion, theta + d, 0.9, 0.0) for d in (step, -step)]
        along, across = (np.subtract(*near)) / (2 * step)
        rim = -WHEEL.radius_m * (1 - (1 - slip) * math.cos(theta))
        assert along == pytest.approx(rim, abs=1e-5)
        assert across == pytest.approx(-WHEEL.radius_m * 0.2, abs=1e-5)


@pytest.mark.parametrize("name", SOILS)
def test_a_model_of_another_size_behaves_alike(name: str) -> None:
    """Lengths, K times q, gravity over q, k over q^n, load times q^2: ratios stay, z is q z."""
    q = 3.0
    changed = {"pressure": {"kind": "modulus", "k": 1e6}, "sinkage_exponent": 1.2}
    soil = soil_of(name, **changed, sinkage_exponent_slip=0.0)
    keys = [key for key in type(soil).model_fields if key.startswith("shear_modulus")]
    scaled = {key: q * getattr(soil, key) for key in keys}
    large = MechanicalSoilSpec.model_validate(
        {
            **soil.model_dump(),
            **scaled,
            "pressure": {"kind": "modulus", "k": 1e6 / q**1.2},
        }
    )
    wheel = WheelSpec(radius_m=q * WHEEL.radius_m, width_m=q * WHEEL.width_m)
    small = wheel_forces(soil, WHEEL, [0.1, 0.6], 0.2, LOAD_N, MARS_MPS2)
    big = wheel_forces(large, wheel, [0.1, 0.6], 0.2, q**2 * LOAD_N, MARS_MPS2 / q)
    np.testing.assert_allclose(big.sinkage_m, q * small.sinkage_m, rtol=1e-9)
    for key, power in (("drawbar_n", 2), ("side_n", 2), ("torque_nm", 3), ("compaction_n", 2)):
        np.testing.assert_allclose(getattr(big, key), q**power * getattr(small, key), rtol=1e-8)


@pytest.mark.parametrize("name", SOILS)
def test_left_and_right_are_mirrored(name: str) -> None:
    """Creep to the other side turns the side force alone; without creep there is none."""
    soil = soil_of(name)
    left, right, straight = (
        wheel_forces(soil, WHEEL, [-0.5, 0.1], creep, LOAD_N, MARS_MPS2)
        for creep in (0.2, -0.2, 0.0)
    )
    assert (left.side_n < 0).all()
    np.testing.assert_array_equal(left.side_n, -right.side_n)
    np.testing.assert_array_equal(left.drawbar_n, right.drawbar_n)
    np.testing.assert_array_equal(straight.side_n, 0.0)


@pytest.mark.parametrize("name", SOILS)
def test_no_wheel_gets_more_than_its_motor_and_the_slope_give(name: str) -> None:
    """``M omega + |S| v_y >= T v`` at every slip and creep: soil takes energy, it gives none."""
    slip = np.concatenate([-np.geomspace(0.01, 20.0, 12), np.linspace(0.0, 1.0, 12)])[:, None]
    creep = np.array([0.0, 0.02, 0.2, 1.0])
    f = wheel_forces(soil_of(name), WHEEL, slip, creep, LOAD_N, MARS_MPS2)
    lost = f.torque_nm / WHEEL.radius_m - f.side_n * creep - f.drawbar_n * (1 - slip)
    assert (lost / LOAD_N).min() > 0


@pytest.mark.parametrize("name", SOILS)
def test_a_heavier_wheel_sinks_deeper(name: str) -> None:
    """Sinkage and compaction resistance rise with load."""
    load = np.geomspace(20.0, 600.0, 8)
    forces = wheel_forces(soil_of(name), WHEEL, 0.1, 0.0, load, MARS_MPS2)
    assert forces.carried.all()
    assert (np.diff(forces.sinkage_m) > 0).all()
    assert (np.diff(forces.compaction_n / load) > 0).all()


@pytest.mark.parametrize("name", SOILS)
def test_drawbar_pull_rises_from_skid_to_a_fifth_of_slip(name: str) -> None:
    """A braked wheel holds back, a slipping one pulls more, as far as slip-sinkage lets it."""
    slip = np.array([-0.5, -0.2, -0.05, 0.0, 0.05, 0.1, 0.2])
    forces = wheel_forces(soil_of(name), WHEEL, slip, 0.0, LOAD_N, MARS_MPS2)
    assert (np.diff(forces.drawbar_n) > 0).all()


def test_slip_sinkage_lowers_the_most_that_soil_gives() -> None:
    """Where the exponent grows with slip the wheel digs in and its pull falls again."""
    slip = np.linspace(0.1, 1.0, 19)
    pulls = {}
    for growth in (0.0, 0.6):
        soil = soil_of("grc1_fitted", sinkage_exponent_slip=growth, rear_angle_slip=0.0)
        forces = wheel_forces(soil, WHEEL, slip, 0.0, LOAD_N, MARS_MPS2)
        pulls[growth] = forces.drawbar_n
    assert np.argmax(pulls[0.6]) < np.argmax(pulls[0.0])
    assert pulls[0.6].max() < pulls[0.0].max()


def test_a_locked_wheel_is_the_limit_of_skid() -> None:
    """The forces no longer change when the wheel turns a million times slower than it rolls."""
    slow, locked = (
        wheel_forces(soil_of("lunar_simulant"), WHEEL, slip, 0.0, LOAD_N, MARS_MPS2)
        for slip in (-1e6, -1e8)
    )
    assert float(slow.drawbar_n) == pytest.approx(float(locked.drawbar_n), rel=1e-4)


def test_grousers_make_the_wheel_larger() -> None:
    """A grousered wheel is the cylinder through its tips; grousers that are not there add none."""
    lugged = WheelSpec(radius_m=0.13, width_m=0.12, grouser_height_m=0.0125, grouser_count=18)
    bare = WheelSpec(radius_m=0.1425, width_m=0.12, grouser_height_m=0.02, grouser_count=0)
    assert rolling_radius(lugged) == pytest.approx(rolling_radius(bare))
    one, other = (
        wheel_forces(soil_of("mars_sand"), w, 0.2, 0.1, LOAD_N, MARS_MPS2) for w in (lugged, bare)
    )
    assert float(one.drawbar_n) == pytest.approx(float(other.drawbar_n), rel=1e-9)


def test_soil_pushed_aside_resists_as_hegedus_says() -> None:
    """As ``X + phi`` is ``90 deg - X``, D1 is ``2 cot X``; with c only, that times c and depth."""
    soil = soil_of("cmu_sand")
    failure = math.pi / 4 - soil.friction_rad / 2
    linear, square = flank_coefficients(soil, 9.81)
    first = 2 / math.tan(failure)
    second = 1 / math.tan(failure) + math.tan(soil.friction_rad) / math.tan(failure) ** 2
    assert linear == pytest.approx(first * 1000.0)
    assert square == pytest.approx(first * second * 1330.0 * 9.81 / 2)


def test_a_load_that_the_soil_does_not_carry_is_said() -> None:
    """The wheel is sunk to its axle, and the answer says that the load is not carried."""
    forces = wheel_forces(soil_of("cmu_sand"), WHEEL, 0.2, 0.0, [LOAD_N, 1e5], MARS_MPS2)
    assert forces.carried.tolist() == [True, False]
    assert forces.sinkage_m[1] == pytest.approx(WHEEL.radius_m)


@pytest.mark.parametrize(
    ("changed", "width_m", "gravity_mps2", "sentence"),
    [
        ({"pressure": {"kind": "bekker", "kc": -2e5, "kphi": 1e6}}, 0.12, 3.71, "width 0.12 m"),
        ({"pressure": {"kind": "reece", "kc": 1, "kphi": 1}, "cohesion_pa": 0}, 0.3, 0.0, "0 m/s2"),
    ],
)
def test_a_soil_that_presses_back_nowhere_is_refused(
    changed: dict[str, object], width_m: float, gravity_mps2: float, sentence: str
) -> None:
    """A cohesive modulus below 0 is, for a wheel too narrow, and sand is without its weight."""
    wheel = WheelSpec(radius_m=0.1425, width_m=width_m)
    with pytest.raises(SpecError, match=sentence):
        law_of(soil_of("cmu_sand", **changed), wheel, gravity_mps2)
    law_of(soil_of("cmu_sand", **changed), WheelSpec(radius_m=0.1425, width_m=0.5), 3.71)
