"""Constants of the model for C++: `jeat_graph/core/constants.hpp` is written from those of Python.

`python .ci/core_constants.py` writes the header, which is kept in the repository, so that a build needs no
Python of ours; a test compares both. What a constant is, its unit and its source stand beside it in Python.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
HEADER = ROOT / "jeat_graph" / "core" / "constants.hpp"
#: By namespace and module of Python: names in C++, and there. A name with a number is one of several.
CONSTANTS: dict[str, dict[str, dict[str, str]]] = {
    "filters": {
        "jeat_graph.filters.singer": {
            "kPosition": "POSITION",
            "kVelocity": "VELOCITY",
            "kAcceleration": "ACCELERATION",
            "kLogSize": "LOG_SIZE",
            "kGrowth": "GROWTH",
            "kPositionError": "POSITION_ERROR",
            "kSizeError": "SIZE_ERROR",
            "kStates": "STATES",
            "kMotion": "MOTION",
            "kTicksPerS": "_TICKS_PER_S",
            "kLeastPerspective": "_LEAST_PERSPECTIVE",
        },
        "jeat_graph.filters.sensor_accuracy": {
            "kSweeps": "_SWEEPS",
            "kLeastShare": "_LEAST_SHARE",
            "kToSides": "_TO_SIDES",
        },
        "jeat_graph.filters.visibility": {
            "kVisible": "VISIBLE",
            "kHidden": "HIDDEN",
            "kGone": "GONE",
            "kPresences": "PRESENCES",
        },
        "jeat_graph.filters.box_sides": {
            "kLeastArea": "_LEAST_AREA",
            "kLog2Pi": "_LOG_2PI",
            "kLeastProbability": "_LEAST_PROBABILITY",
            "kLeastWeight": "_LEAST_WEIGHT",
            "kOutwards": "_OUTWARDS",
            "kMostDistance": "_MOST_DISTANCE",
            "kUnmeasured": "_UNMEASURED",
        },
        "jeat_graph.filters.sensor_offsets": {"kLeastPrecision": "_LEAST"},
        "jeat_graph.filters.picture_motion": {"kSpansKnown": "_SPANS_KNOWN"},
        "jeat_graph.filters.camera_motion": {
            "kPairingGate": "_GATE",
            "kPairingDeviations": "_PAIRING_DEVIATIONS",
            "kPairingMost": "_PAIRING_MOST",
            "kReweighting": "_DEGREES",
            "kReweightings": "_ITERATIONS",
            "kLeastTracks": "_LEAST_TRACKS",
            "kLeastWitnesses": "_LEAST_WITNESSES",
            "kLeastTenths": "_LEAST_TENTHS",
        },
        "jeat_graph.filters.gap_survival": {"kGapBinEnds": "GAP_BINS"},
        "jeat_graph.filters.score_calibration": {
            "kFirstLogit": "_FIRST_LOGIT",
            "kLogitStep": "_LOGIT_STEP",
            "kScoreBins": "_SCORE_BINS",
            "kBandwidth": "_BANDWIDTH",
            "kBestCount": "_BEST_COUNT",
            "kLeastBoxes": "_LEAST_BOXES",
            "kLeastVariance": "_LEAST_VARIANCE",
            "kMostCorrelation": "_MOST_CORRELATION",
        },
        "jeat_graph.filters.object_probability": {
            "kLeastApart": "_LEAST_APART",
            "kLeastSum": "_LEAST_WEIGHT",
            "kMostLogOdds": "_MOST_LOG_ODDS",
            "kRounds": "_ROUNDS",
            "kLeastMisses": "_LEAST_MISSES",
            "kLeastScans": "_LEAST_SCANS",
        },
    },
    "association": {
        "jeat_graph.association.likelihood_ratio": {
            "kLeastPDetect": "_P_DETECT_BOUNDS 0",
            "kMostPDetect": "_P_DETECT_BOUNDS 1",
            "kLeastPosterior": "_LEAST_POSTERIOR",
        },
        "jeat_graph.tracking.reference": {"kLeastGain": "_LEAST_GAIN"},
    },
    "smoothers": {"jeat_graph.smoothers.histories": {"kGolden": "_GOLDEN", "kLowBits": "_LOW_BITS"}},
    "tracking": {
        "jeat_graph.tracking.engine": {"kLongestSilenceS": "LONGEST_SILENCE_S"},
        "jeat_graph.tracking.reference": {
            "kPeriodMemory": "_PERIOD_MEMORY",
            "kCameraDetections": "_CAMERA_DETECTIONS",
            "kCameraAgeS": "_CAMERA_AGE_S",
        },
        "jeat_graph.tracking.reference_life": {
            "kSameTimeS": "_SAME_TIME_S",
            "kLongestAgoS": "_LONGEST_AGO_S",
        },
    },
}


def _defined(name: str, value: Any) -> str:
    """One definition in C++. A float's shortest text is read back as the same number."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, list):
        numbers = ", ".join(repr(float(one)) for one in value)
        return f"inline constexpr std::array<double, {len(value)}> {name}{{{numbers}}};"
    return f"inline constexpr {'int' if isinstance(value, int) else 'double'} {name} = {value!r};"


def _definitions(modules: dict[str, dict[str, str]]) -> Iterator[str]:
    for module, names in modules.items():
        yield f"// {module.removeprefix('jeat_graph.')}"
        for name, there in names.items():
            there, *place = there.split()
            value = getattr(importlib.import_module(module), there)
            yield _defined(name, value[int(place[0])] if place else value)


def header() -> str:
    """Return the text of the header."""
    from jeat_graph.filters.model_constants import ModelConstants

    constants = ModelConstants()
    given = [
        f"    {'JEAT_PAIR' if isinstance(getattr(constants, one.name), tuple) else 'JEAT_ONE'}({one.name})"
        for one in fields(constants)
    ]
    parts = [
        "// Written by .ci/core_constants.py from the constants of Python, which say what each is.\n"
        "#pragma once\n\n#include <array>\n\n// clang-format off"
    ]
    for space, modules in CONSTANTS.items():
        lines = "\n".join(_definitions(modules))
        parts.append(f"namespace jeat::{space} {{\n\n{lines}\n\n}}  // namespace jeat::{space}")
    listed = " \\\n".join(["#define JEAT_MODEL_CONSTANTS", *given])
    parts.append(
        f"// Those that a tracker may be given other values of: filters/model_constants.py.\n{listed}"
    )
    return "\n\n".join(parts) + "\n// clang-format on\n"


def main() -> None:
    """Write the header."""
    sys.path.insert(0, str(ROOT))
    HEADER.write_text(header(), encoding="utf-8")


if __name__ == "__main__":
    main()
