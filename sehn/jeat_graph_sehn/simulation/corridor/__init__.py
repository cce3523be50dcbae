"""A road with several cameras along it: traffic, ramps, queues, and the cameras' tables with their clocks."""
