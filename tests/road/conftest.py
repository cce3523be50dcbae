import importlib.util
import sys
from pathlib import Path

# Test files are imported each on its own (importlib mode); what they share is made a module here.
_spec = importlib.util.spec_from_file_location("road_scenes", Path(__file__).with_name("scenes.py"))
assert _spec is not None
assert _spec.loader is not None
scenes = importlib.util.module_from_spec(_spec)
sys.modules["road_scenes"] = scenes
_spec.loader.exec_module(scenes)
