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

_SCHEMA = "http://datex2.eu/schema/3"
_ROOT = {
    "xmlns:d2": f"{_SCHEMA}/d2Payload",
    "xmlns:com": f"{_SCHEMA}/common",
    "xmlns:roa": f"{_SCHEMA}/roadTrafficData",
    "xmlns:xsi": "http://www.w3.org/2001/XMLSchema-instance",
    "xsi:type": "roa:MeasuredDataPublication",
    "lang": "en",
    "modelBaseVersion": "3",
}
_VERSION = "1"
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
    root = ElementTree.Element("d2:payload", _ROOT)
    _text(root, "com:publicationTime", _time(publication.time))
    creator = ElementTree.SubElement(root, "com:publicationCreator")
    _text(creator, "com:country", publication.country)
    _text(creator, "com:nationalIdentifier", publication.publisher)
    table = {"targetClass": "roa:MeasurementSiteTable", "id": publication.table, "version": _VERSION}
    ElementTree.SubElement(root, "roa:measurementSiteTableReference", table)
    header = ElementTree.SubElement(root, "roa:headerInformation")
    _text(header, "com:informationStatus", "real")
    types = sorted({_type(name) for one in intervals for name in one.by_class})
    for one in intervals:
        _add_site(root, one, types)
    ElementTree.indent(root)
    with open_atomic(path) as file:
        file.write('<?xml version="1.0" encoding="UTF-8"?>\n')
        file.write(ElementTree.tostring(root, encoding="unicode") + "\n")


def _add_site(root: ElementTree.Element, one: SiteInterval, types: Sequence[str]) -> None:
    """Add the quantities of a site and interval, in the order of the schema."""
    site = ElementTree.SubElement(root, "roa:siteMeasurements")
    place = {"targetClass": "roa:MeasurementSite", "id": one.site, "version": _VERSION}
    ElementTree.SubElement(site, "roa:measurementSiteReference", place)
    _add_flow(site, 1, one, one.count, _ANY)
    for index, kind, outer, inner, value in (
        (2, "TrafficConcentration", "roa:occupancy", "com:percentage", one.occupancy),
        (3, "TrafficHeadway", "roa:averageTimeHeadway", "roa:duration", one.headway_s),
        (4, "TrafficSpeed", "roa:averageVehicleSpeed", "com:speed", one.speed_kmh),
    ):
        if not math.isnan(value):
            measured = ElementTree.SubElement(_basic_data(site, index, kind), outer)
            _text(measured, inner, f"{round(value, _PLACES):g}")
    counts = dict.fromkeys(types, 0)
    for name, count in one.by_class.items():
        counts[_type(name)] += count
    for index, kind in enumerate(types, 5):
        _add_flow(site, index, one, counts[kind], kind)
    default = ElementTree.SubElement(site, "roa:measurementTimeDefault")
    _text(default, "roa:timeMeaning", "endTime")
    _text(default, "roa:timeValue", _time(one.end))
    period = ElementTree.SubElement(default, "roa:period")
    _text(period, "com:startOfPeriod", _time(one.begin))
    _text(period, "com:endOfPeriod", _time(one.end))


def _add_flow(site: ElementTree.Element, index: int, one: SiteInterval, count: int, kind: str) -> None:
    """Add the flow of a type of vehicles; of an interval that was not watched it is an error."""
    data = _basic_data(site, index, "TrafficFlow")
    vehicles = ElementTree.SubElement(data, "roa:forVehiclesWithCharacteristicsOf")
    _text(vehicles, "com:vehicleType", kind)
    watched = not math.isnan(one.flow_per_hour)
    about = {
        "numberOfInputValuesUsed": str(count),
        "supplierCalculatedDataQuality": f"{round(one.observed, _PLACES):g}",
    }
    flow = ElementTree.SubElement(data, "roa:vehicleFlow", about)
    if not watched:
        _text(flow, "com:dataError", "true")
    share = count / one.count if one.count else 0.0
    rate = round(one.flow_per_hour * share) if watched else 0
    _text(flow, "com:vehicleFlowRate", str(rate))


def _basic_data(site: ElementTree.Element, index: int, kind: str) -> ElementTree.Element:
    outer = ElementTree.SubElement(site, "roa:physicalQuantity", {"index": str(index)})
    single = {"xsi:type": "roa:SinglePhysicalQuantity"}
    quantity = ElementTree.SubElement(outer, "roa:physicalQuantity", single)
    return ElementTree.SubElement(quantity, "roa:basicData", {"xsi:type": f"roa:{kind}"})


def _text(parent: ElementTree.Element, name: str, text: str) -> None:
    ElementTree.SubElement(parent, name).text = text


def _type(name: str) -> str:
    return _TYPES.get(name.lower(), _OTHER)


def _time(when: datetime) -> str:
    """Return a time as XML has it, in whole seconds where it is one."""
    return when.isoformat(timespec="milliseconds" if when.microsecond else "seconds")
