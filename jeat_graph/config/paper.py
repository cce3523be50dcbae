"""Placeholder."""
from dataclasses import dataclass
from jeat_graph.config.fields import Section
@dataclass(frozen=True)
class PaperConfig(Section):
    """x"""
