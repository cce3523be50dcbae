"""Every command that writes, as the tests of kills call it.

Names in braces stand for inputs, `{out}` for the folder that is written to.
"""

from __future__ import annotations

_DETECTIONS = "{recording}/detections.csv"
_TRUTH = ("--gt", "{recording}/gt.csv")
_SEGMENT = "{pictures}/segments/000000"
_SMALL = ("--segments", "2", "--frames", "10", "--size", "160x96", "--workers", "2")

COMMANDS: dict[str, tuple[str, ...]] = {
    "track-causal": ("track", _DETECTIONS, "--out", "{out}/run", "--smoother", "none"),
    "track": ("track", _DETECTIONS, "--out", "{out}/run"),
    "track-resume": ("track", _DETECTIONS, "--out", "{out}/run", "--resume"),
    "simulate": ("simulate", "night", "--duration", "2", "--out", "{out}/set"),
    "simulate-pictures": ("simulate", "night", "--sensors", "pictures", *_SMALL, "--out", "{out}/set"),
    "calibrate": ("calibrate", _DETECTIONS, *_TRUTH, "--out", "{out}/c.yaml"),
    "report": ("report", "{run}", *_TRUTH, "--out", "{out}/page.html"),
    "render": ("render", "{run}", "--out", "{out}/film.mp4"),
    "compare": ("compare", "{run}", *_TRUTH, "--out", "{out}/compared"),
    "benchmarks": ("benchmarks", "events", "--quick", "--out", "{out}/events"),
    "stream": ("stream", "--smoothed", "{out}/s.csv", "--checkpoint", "{out}/c.npz", "--every", "0.5"),
    "detect": ("detect", "--frames", f"{_SEGMENT}/frames.mp4", "--out", "{out}/d.csv"),
    "events-convert": ("events", "convert", f"{_SEGMENT}/events.h5", "{out}/e.raw"),
    "batch": ("batch", "{manifest}", "--out", "{out}/batch", "--workers", "2"),
    "road": ("road", "{run}", "--camera", "{recording}/camera.yaml", "--out", "{out}/road"),
    "eval": ("eval", "{run}", *_TRUTH, "--json", "{out}/scores.json"),
    "count": ("count", "{run}", "--line", "640,0,640,720", "--out", "{out}/counts.csv"),
}
#: What a kill may leave at any length: rows of a stream that were final.
MAY_GROW = {"s.csv"}
#: What is written anew, whole, while the command goes on, or tells of workers that died.
WRITTEN_AGAIN = {"c.npz", "recordings.csv"}
