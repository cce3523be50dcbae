"""Traffic data of stations as DATEX II v3: a `MeasuredDataPublication`, one record a site and interval.

============================  ===============================================================================
`measurementSiteReference`    the station, its direction and lane (`NAME-left-LANE`), of the table referred to
`measurementTimeDefault`      the interval: its end, and the period
`physicalQuantity`, index 1   `TrafficFlow` of all vehicles: vehicles an hour, and how many were counted
index 2, 3, 4                 occupancy (`TrafficConcentration`, per cent), headway (s), and speed (km/h)
index 5, 6, …                 `TrafficFlow` by type of vehicle
============================  ===============================================================================

What was not measured has no quantity; of an interval that was not watched the flow is a data error. Elements,
their order and their types are those of the schema of version 3.7 (`DATEXII_3_D2Payload`, `RoadTrafficData`,
`Common`). Source: https://docs.datex2.eu, CEN EN 16157-5.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from xml.etree import ElementTree

from jeat_graph.io.files.atomic import open_atomic

SCHEMA = "http://datex2.eu/schema/3"
_ROOT = {
    "xmlns:d2": f"{SCHEMA}/d2Payload",
    "xmlns:com": f"{SCHEMA}/common",
    "xmlns:roa": f"{SCHEMA}/roadTrafficData",
    "xmlns:xsi": "http://www.w3.org/2001/XMLSchema-instance",
    "lang": "en",
    "modelBaseVersion": "3",
}
SITE_VERSION = "1"
#: Types of vehicles (`VehicleTypeEnum`) by the names that detectors give; the others are `other`.
_TYPES = {
    "car": "car",
    "truck": "lorry",
    "lorry": "lorry",
    "bus": "bus",
    "van": "van",
    "motorcycle": "motorcycle",
    "motorbike": "motorcycle",
    "bicycle": "bicycle",
    "trailer": "trailer",
    "tram": "tram",
}
_OTHER, _ANY = "other", "anyVehicle"
#: Index of the first flow by type of vehicle.
FIRST_TYPE = 5
#: Decimal places of shares, times and speeds.
_PLACES = 3


@dataclass(frozen=True)
class SiteInterval:
    """What a site measured in an interval; NaN where it is not known.

    Attributes:
        site: identifier of the site.
        begin: of the interval, with a time zone.
        end: of the interval.
        observed: share of it that was watched (per cent).
        count: vehicles.
        flow_per_hour: vehicles an hour, of the time that was watched.
        occupancy: share of that time in which a vehicle covers the station (per cent).
        headway_s: mean time since the vehicle before (s).
        speed_kmh: mean speed (km/h).
        by_class: vehicles of each class.
    """

    site: str
    begin: datetime
    end: datetime
    observed: float
    count: int
    flow_per_hour: float
    occupancy: float
    headway_s: float
    speed_kmh: float
    by_class: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Publication:
    """Who publishes, when, and which table the sites are of.

    Attributes:
        time: of the publication, with a time zone.
        country: two letters (ISO 3166).
        publisher: identifier within the country.
        table: identifier of the table of measurement sites.
    """

    time: datetime
    country: str
    publisher: str
    table: str


def write_datex2(intervals: Sequence[SiteInterval], publication: Publication, path: str | Path) -> None:
    """Write a `MeasuredDataPublication`; the same input gives the same bytes.

    Args:
        intervals: at least one.
        publication: who publishes, and when.
        path: the file.

    Raises:
        DataError: it cannot be written.
    """
    root = root_of("MeasuredDataPublication")
    add_publication(root, publication)
    table = {"targetClass": "roa:MeasurementSiteTable", "id": publication.table, "version": SITE_VERSION}
    ElementTree.SubElement(root, "roa:measurementSiteTableReference", table)
    header = ElementTree.SubElement(root, "roa:headerInformation")
    add_text(header, "com:informationStatus", "real")
    types = types_of(intervals)
    for one in intervals:
        _add_site(root, one, types)
    write_payload(root, path)


def root_of(kind: str, more: Mapping[str, str] | None = None) -> ElementTree.Element:
    """Return the root of a publication of a kind, with further name spaces."""
    spaces = {name: value for name, value in _ROOT.items() if name.startswith("xmlns:")} | dict(more or {})
    others = {name: value for name, value in _ROOT.items() if name not in spaces}
    return ElementTree.Element("d2:payload", {**spaces, "xsi:type": f"roa:{kind}", **others})


def add_publication(root: ElementTree.Element, publication: Publication) -> None:
    """Add when it is published, and by whom."""
    add_text(root, "com:publicationTime", _time(publication.time))
    creator = ElementTree.SubElement(root, "com:publicationCreator")
    add_text(creator, "com:country", publication.country)
    add_text(creator, "com:nationalIdentifier", publication.publisher)


def types_of(intervals: Sequence[SiteInterval]) -> list[str]:
    """Return the types of vehicles that have flows of their own, in the order of their indices."""
    return sorted({_type(name) for one in intervals for name in one.by_class})


def write_payload(root: ElementTree.Element, path: str | Path) -> None:
    """Write a publication, whole or not at all."""
    ElementTree.indent(root)
    with open_atomic(path) as file:
        file.write('<?xml version="1.0" encoding="UTF-8"?>\n')
        file.write(ElementTree.tostring(root, encoding="unicode") + "\n")


def _add_site(root: ElementTree.Element, one: SiteInterval, types: Sequence[str]) -> None:
    """Add the quantities of a site and interval, in the order of the schema."""
    site = ElementTree.SubElement(root, "roa:siteMeasurements")
    place = {"targetClass": "roa:MeasurementSite", "id": one.site, "version": SITE_VERSION}
    ElementTree.SubElement(site, "roa:measurementSiteReference", place)
    _add_flow(site, 1, one, one.count, _ANY)
    for index, kind, outer, inner, value in (
        (2, "TrafficConcentration", "roa:occupancy", "com:percentage", one.occupancy),
        (3, "TrafficHeadway", "roa:averageTimeHeadway", "roa:duration", one.headway_s),
        (4, "TrafficSpeed", "roa:averageVehicleSpeed", "com:speed", one.speed_kmh),
    ):
        if not math.isnan(value):
            measured = ElementTree.SubElement(_basic_data(site, index, kind), outer)
            add_text(measured, inner, f"{round(value, _PLACES):g}")
    counts = dict.fromkeys(types, 0)
    for name, count in one.by_class.items():
        counts[_type(name)] += count
    for index, kind in enumerate(types, FIRST_TYPE):
        _add_flow(site, index, one, counts[kind], kind)
    default = ElementTree.SubElement(site, "roa:measurementTimeDefault")
    add_text(default, "roa:timeMeaning", "endTime")
    add_text(default, "roa:timeValue", _time(one.end))
    period = ElementTree.SubElement(default, "roa:period")
    add_text(period, "com:startOfPeriod", _time(one.begin))
    add_text(period, "com:endOfPeriod", _time(one.end))


def _add_flow(site: ElementTree.Element, index: int, one: SiteInterval, count: int, kind: str) -> None:
    """Add the flow of a type of vehicles; of an interval that was not watched it is an error."""
    data = _basic_data(site, index, "TrafficFlow")
    vehicles = ElementTree.SubElement(data, "roa:forVehiclesWithCharacteristicsOf")
    add_text(vehicles, "com:vehicleType", kind)
    watched = not math.isnan(one.flow_per_hour)
    about = {
        "numberOfInputValuesUsed": str(count),
        "supplierCalculatedDataQuality": f"{round(one.observed, _PLACES):g}",
    }
    flow = ElementTree.SubElement(data, "roa:vehicleFlow", about)
    if not watched:
        add_text(flow, "com:dataError", "true")
    share = count / one.count if one.count else 0.0
    rate = round(one.flow_per_hour * share) if watched else 0
    add_text(flow, "com:vehicleFlowRate", str(rate))


def _basic_data(site: ElementTree.Element, index: int, kind: str) -> ElementTree.Element:
    outer = ElementTree.SubElement(site, "roa:physicalQuantity", {"index": str(index)})
    single = {"xsi:type": "roa:SinglePhysicalQuantity"}
    quantity = ElementTree.SubElement(outer, "roa:physicalQuantity", single)
    return ElementTree.SubElement(quantity, "roa:basicData", {"xsi:type": f"roa:{kind}"})


def add_text(parent: ElementTree.Element, name: str, text: str) -> None:
    """Add an element that holds a text."""
    ElementTree.SubElement(parent, name).text = text


def _type(name: str) -> str:
    return _TYPES.get(name.lower(), _OTHER)


def _time(when: datetime) -> str:
    """Return a time as XML has it, in whole seconds where it is one."""
    return when.isoformat(timespec="milliseconds" if when.microsecond else "seconds")
