"""From raw pictures and raw events to detections: windows, noise, detectors with and without weights."""
