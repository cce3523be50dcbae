"""Lenses that bend, of a rig: found in the graph where residuals say so, written, and read again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from jeat_graph import load_config
from jeat_graph.config.rig_file import rig_text, sensor_entry
from jeat_graph.data.errors import DataError
from jeat_graph.data.lens import RadialLens
from jeat_graph.data.picture_map import PictureMap
from jeat_graph.rig.between_vehicles import jackknife, lens_evidence
from jeat_graph.rig.common_picture import CommonPicture
from jeat_graph.rig.matching import MatchedTracks
from jeat_graph.rig.refining import Refined, refine, with_lenses
from jeat_graph.rig.sensor_tracks import SensorTracks, TrackMeasurements
from jeat_graph.smoothers.gtsam.shared_paths import SharedPaths

SIZES = ((1280.0, 720.0), (640.0, 480.0))
VEHICLES = 40
# From the second picture to the first.
PLANE = np.array([[1.7, 0.03, 40.0, 0.0], [-0.02, 1.6, -30.0, 0.0], [1e-5, 4e-5, 1.0, 0.0]])


def shared(scatter: float = 0.5, m: int = 4, number: int = 30) -> SharedPaths:
    """A solved system about its own solution."""
    rng = np.random.default_rng(3)
    J = rng.normal(size=(number, 6, m))
    right = rng.normal(size=(number, 6)) + scatter * rng.normal(size=(number, 1))
    information, vector = np.einsum("pri,prj->pij", J, J), np.einsum("pri,pr->pi", J, right)
    prior = 0.1 * np.eye(m)
    solution = np.linalg.solve(information.sum(axis=0) + prior, vector.sum(axis=0))
    left = vector - information @ solution
    here = np.linalg.solve(information.sum(axis=0) + prior, left.sum(axis=0) - prior @ solution)
    return SharedPaths([], here + solution, information, vector, prior)


def test_the_jackknife_is_what_leaving_out_each_vehicle_does() -> None:
    solved = shared()
    whole = solved.information.sum(axis=0) + solved.prior
    rest = []
    for k in range(len(solved.vector)):
        kept = [p for p in range(len(solved.vector)) if p != k]
        A = solved.information[kept].sum(axis=0) + solved.prior
        rest.append(np.linalg.solve(A, solved.vector[kept].sum(axis=0)))
    moved = np.array(rest) - np.linalg.solve(whole, solved.vector.sum(axis=0))
    right = (len(rest) - 1) / len(rest) * moved.T @ moved
    right += np.linalg.inv(whole) @ solved.prior @ np.linalg.inv(whole)
    np.testing.assert_allclose(jackknife(solved), right, rtol=1e-9)


def test_evidence_is_that_of_walds_statistic() -> None:
    solved = shared()
    found = lens_evidence(solved, slice(2, 4))
    cov = jackknife(solved)[2:, 2:]
    assert found.statistic == pytest.approx(solved.shared[2:] @ np.linalg.inv(cov) @ solved.shared[2:])
    assert found.p_value == pytest.approx(np.exp(-0.5 * found.statistic))  # chi-square of 2


def scene(k1: tuple[float, float] | None, seed: int) -> Refined:
    """Vehicles that cross both pictures, as each sensor has them, and what the graph makes of them."""
    rng = np.random.default_rng(seed)
    true = PictureMap(PLANE)
    if k1 is not None:
        true = replace(
            true, lenses=(RadialLens.of_picture(k1[0], SIZES[1]), RadialLens.of_picture(k1[1], SIZES[0]))
        )
    ours, theirs = [], []
    for _ in range(VEHICLES):
        t = np.arange(0.0, 4.0, 0.2)
        start, end = rng.uniform([40.0, 40.0], [600.0, 440.0], (2, 2))
        place = start + (end - start) * (t / t[-1])[:, None]
        size = np.full((len(t), 2), 30.0)
        common = true.points(place, size[:, 1])
        noise = rng.normal(0.0, 0.4, (2, 2)) * [[1.0], [1.0]]
        seen = common + noise[0] + rng.normal(0.0, 0.6, common.shape)
        found = place + 0.5 * noise[1] + rng.normal(0.0, 0.3, place.shape)
        ours.append(TrackMeasurements(t, seen, 1.65 * size))
        theirs.append(TrackMeasurements(t + 0.5, found, size))
    none = np.zeros((0, 0, 2))
    first, second = (SensorTracks(0.0, none, none, one, np.ones(VEHICLES)) for one in (ours, theirs))
    rows = np.arange(VEHICLES)
    matched = MatchedTracks(rows, rows, PictureMap(PLANE), 0.5, VEHICLES)
    straight = refine(first, second, matched, SIZES)
    assert straight.bends is not None
    if straight.bends.p_value > 1e-3:
        return straight
    bent = matched._replace(way=with_lenses(straight.way, SIZES))
    return refine(first, second, bent, SIZES)


def test_lenses_that_bend_are_found_with_their_distortion() -> None:
    k1 = (-0.12, -0.2)
    found = scene(k1, 0)
    assert found.way.lenses is not None
    std = np.sqrt(np.diag(found.way.covariance))[-2:]
    error = np.array([lens.k1 for lens in found.way.lenses]) - k1
    assert (np.abs(error) < 3.0 * std).all()
    assert (std < 0.06).all()


@pytest.mark.parametrize("seed", [1, 2])
def test_lenses_that_do_not_bend_are_left_as_they_are(seed: int) -> None:
    assert scene(None, seed).way.lenses is None


def test_lenses_are_written_and_read_again(tmp_path: Path) -> None:
    lenses = RadialLens.of_picture(-0.1, SIZES[1]), RadialLens.of_picture(-0.2, SIZES[0])
    way = PictureMap(PLANE, np.diag(np.arange(1.0, 14.0)), lenses)
    entry = sensor_entry(way, None, (640, 480))
    rig = tmp_path / "rig.yaml"
    rig.write_text(rig_text((1280, 720), {"evt": entry}, []))
    read = CommonPicture.of(load_config(rig=rig)).ways["evt"].picture
    assert read is not None
    assert read.lenses == lenses
    kept = [k for k in range(13) if k not in (3, 7, 10)]  # without parallax
    np.testing.assert_array_equal(read.covariance[kept][:, kept], way.covariance[kept][:, kept])


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("lens: [0.1]", "sensors.evt.lens: must be two numbers from -1 to 1, not"),
        ("lens: [0.1, 3]", "sensors.evt.lens: must be two numbers from -1 to 1, not"),
        ("lens: [0.1, 0.1]\n    to_picture: scale", "sensors.evt.lens: goes with a matrix"),
    ],
)
def test_lenses_that_are_none_are_refused(tmp_path: Path, line: str, why: str) -> None:
    rig = tmp_path / "rig.yaml"
    way = "" if "to_picture" in line else "\n    to_picture: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]"
    rig.write_text(f"image: [1280, 720]\nsensors:\n  evt:\n    image: [640, 480]\n    {line}{way}\n")
    with pytest.raises(DataError, match=why.replace("[", r"\[")):
        load_config(rig=rig)
