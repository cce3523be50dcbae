"""Measured data as DATEX II: the structure that its schema asks for, and the numbers that go in."""

from __future__ import annotations

import math
import re
from datetime import datetime
from typing import NamedTuple
from xml.etree import ElementTree

import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.io.exports.datex2 import Publication, SiteInterval, write_datex2
from jeat_graph.io.exports.datex2_sites import SitePlace, place_of, read_places, write_sites

BASE = "http://datex2.eu/schema/3/"
XSI = "{http://www.w3.org/2001/XMLSchema-instance}type"
NAMES = {"com": f"{BASE}common", "roa": f"{BASE}roadTrafficData", "loc": f"{BASE}locationReferencing"}


class Part(NamedTuple):
    """A child element: its name, its type, and how often it is there at least and at most."""

    name: str
    kind: str
    least: int = 1
    most: float = 1


#: What schema 3.7 says of the types that are used: children in their order, those of the base first. A type
#: in brackets is abstract: `xsi:type` must name one that extends it. Extensions are left out.
DATA_VALUE = [Part("com:dataError", "boolean", 0), Part("com:reasonForDataError", "-", 0)]
BASIC_DATA = [Part("roa:measurementOrCalculationTime", "-", 0)]
TRAFFIC_DATA = [*BASIC_DATA, Part("roa:forVehiclesWithCharacteristicsOf", "com:VehicleCharacteristics", 0)]
TYPES = {
    "roa:MeasuredDataPublication": [
        Part("com:feedDescription", "-", 0),
        Part("com:feedType", "string", 0),
        Part("com:publicationTime", "dateTime"),
        Part("com:publicationCreator", "com:InternationalIdentifier"),
        Part("roa:measurementSiteTableReference", "roa:table", 1, math.inf),
        Part("roa:headerInformation", "com:HeaderInformation"),
        Part("roa:siteMeasurements", "roa:SiteMeasurements", 1, math.inf),
    ],
    "com:InternationalIdentifier": [Part("com:country", "country"), Part("com:nationalIdentifier", "string")],
    "roa:table": [],
    "roa:site": [],
    "com:HeaderInformation": [
        Part("com:confidentiality", "-", 0),
        Part("com:allowedDeliveryChannel", "-", 0, math.inf),
        Part("com:informationStatus", "status"),
    ],
    "roa:SiteMeasurements": [
        Part("roa:measurementSiteReference", "roa:site"),
        Part("roa:physicalQuantity", "roa:indexed", 0, math.inf),
        Part("roa:measurementTimeDefault", "roa:MeasurementOrCalculationTime"),
    ],
    "roa:indexed": [Part("roa:physicalQuantity", "[roa:PhysicalQuantity]")],
    "roa:SinglePhysicalQuantity": [
        Part("roa:forecast", "boolean", 0),
        Part("roa:measurementEquipmentTypeUsed", "-", 0),
        Part("roa:pertinentLocation", "-", 0),
        Part("roa:physicalQuantityFault", "-", 0, math.inf),
        Part("roa:source", "-", 0),
        Part("roa:informationManagerOverride", "-", 0),
        Part("roa:basicData", "[roa:BasicData]", 0),
    ],
    "roa:TrafficFlow": [
        *TRAFFIC_DATA,
        *(Part(f"roa:{name}", "-", 0) for name in ("axleFlow", "pcuFlow", "percentageLongVehicles")),
        Part("roa:vehicleFlow", "com:VehicleFlowValue", 0),
    ],
    "roa:TrafficConcentration": [
        *TRAFFIC_DATA,
        Part("roa:density", "-", 0),
        Part("roa:occupancy", "com:PercentageValue", 0),
    ],
    "roa:TrafficHeadway": [
        *TRAFFIC_DATA,
        Part("roa:averageDistanceHeadway", "-", 0),
        Part("roa:averageTimeHeadway", "roa:DurationValue", 0),
    ],
    "roa:TrafficSpeed": [*TRAFFIC_DATA, Part("roa:averageVehicleSpeed", "com:SpeedValue", 0)],
    "com:VehicleFlowValue": [*DATA_VALUE, Part("com:vehicleFlowRate", "nonNegativeInteger")],
    "com:PercentageValue": [*DATA_VALUE, Part("com:percentage", "float")],
    "roa:DurationValue": [*DATA_VALUE, Part("roa:duration", "float")],
    "com:SpeedValue": [*DATA_VALUE, Part("com:speed", "float")],
    "com:VehicleCharacteristics": [
        Part("com:fuelType", "-", 0, math.inf),
        Part("com:loadType", "-", 0),
        Part("com:vehicleEquipment", "-", 0),
        Part("com:vehicleType", "vehicle", 0, math.inf),
    ],
    "roa:MeasurementOrCalculationTime": [
        Part("roa:timeMeaning", "meaning", 0),
        Part("roa:timeValue", "dateTime", 0),
        Part("roa:period", "com:Period", 0),
    ],
    "roa:MeasurementSiteTablePublication": [
        Part("com:feedDescription", "-", 0),
        Part("com:feedType", "string", 0),
        Part("com:publicationTime", "dateTime"),
        Part("com:publicationCreator", "com:InternationalIdentifier"),
        Part("roa:headerInformation", "com:HeaderInformation"),
        Part("roa:measurementSiteTable", "roa:MeasurementSiteTable", 1, math.inf),
    ],
    "roa:MeasurementSiteTable": [
        Part("roa:measurementSiteTableIdentification", "string", 0),
        Part("roa:measurementSite", "roa:MeasurementSite", 1, math.inf),
        Part("roa:informationManager", "com:InternationalIdentifier", 0),
    ],
    "roa:MeasurementSite": [
        *(Part(f"roa:measurement{name}", "-", 0) for name in ("SiteRecordVersionTime", "EquipmentReference")),
        Part("roa:measurementEquipmentTypeUsed", "-", 0),
        Part("roa:measurementSiteName", "com:MultilingualString", 0),
        Part("roa:measurementSiteNumberOfLanes", "nonNegativeInteger", 0),
        Part("roa:measurementSiteIdentification", "string", 0),
        Part("roa:measurementSpecificCharacteristics", "roa:indexedCharacteristics", 0, math.inf),
        Part("roa:measurementSiteLocation", "[loc:LocationReference]"),
        Part("roa:informationManagerOverride", "com:InternationalIdentifier", 0),
    ],
    "roa:indexedCharacteristics": [Part("roa:measurementSpecificCharacteristics", "roa:Characteristics")],
    "roa:Characteristics": [
        *(Part(f"roa:{name}", "-", 0) for name in ("accuracy", "computationMethod")),
        *(Part(f"roa:{name}", "-", 0) for name in ("defaultMeasurementHeight", "measurementSide")),
        Part("roa:period", "float", 0),
        Part("roa:smoothingFactor", "float", 0),
        Part("roa:specificMeasurementValueType", "measured"),
        Part("roa:specificVehicleCharacteristics", "com:VehicleCharacteristics", 0),
        Part("roa:specificLane", "-", 0, math.inf),
    ],
    "com:MultilingualString": [Part("com:values", "com:values")],
    "com:values": [Part("com:value", "com:inLanguage", 1, math.inf)],
    "com:inLanguage": [],
    "loc:PointLocation": [Part("loc:pointByCoordinates", "loc:PointByCoordinates", 0)],
    "loc:PointByCoordinates": [
        Part("loc:bearing", "degrees", 0),
        Part("loc:pointCoordinates", "loc:PointCoordinates"),
    ],
    "loc:PointCoordinates": [Part("loc:latitude", "float"), Part("loc:longitude", "float")],
    "com:Period": [Part("com:startOfPeriod", "dateTime", 0), Part("com:endOfPeriod", "dateTime", 0)],
}
EXTENDS = {
    "[loc:LocationReference]": {"loc:PointLocation"},
    "[roa:PhysicalQuantity]": {"roa:SinglePhysicalQuantity"},
    "[roa:BasicData]": {
        "roa:TrafficFlow",
        "roa:TrafficConcentration",
        "roa:TrafficHeadway",
        "roa:TrafficSpeed",
    },
}
VALUE = {"numberOfInputValuesUsed": r"\d+", "supplierCalculatedDataQuality": r"\d+(\.\d+)?"}
#: Attributes of a type, what each must look like, and which are required.
ATTRIBUTES = {
    "roa:MeasuredDataPublication": (
        {"lang": r"[a-z]{2}", "modelBaseVersion": "3"},
        {"lang", "modelBaseVersion"},
    ),
    "roa:MeasurementSiteTablePublication": (
        {"lang": r"[a-z]{2}", "modelBaseVersion": "3"},
        {"lang", "modelBaseVersion"},
    ),
    "roa:MeasurementSiteTable": ({"id": ".+", "version": ".+"}, {"id", "version"}),
    "roa:MeasurementSite": ({"id": ".+", "version": ".+"}, {"id", "version"}),
    "roa:indexedCharacteristics": ({"index": r"\d+"}, {"index"}),
    "com:inLanguage": ({"lang": r"[a-z]{2}"}, set()),
    "roa:table": (
        {"targetClass": "roa:MeasurementSiteTable", "id": ".+", "version": ".+"},
        {"id", "targetClass"},
    ),
    "roa:site": ({"targetClass": "roa:MeasurementSite", "id": ".+", "version": ".+"}, {"id", "targetClass"}),
    "roa:indexed": ({"index": r"\d+"}, {"index"}),
    **{name: (VALUE, set()) for name in TYPES if name.endswith("Value")},
}
SIMPLE = {
    "boolean": r"true|false|0|1",
    "string": r".{0,1024}",
    "country": r".{0,2}",
    "dateTime": r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?(Z|[+-]\d\d:\d\d)?",
    "float": r"-?\d+(\.\d+)?(e[+-]?\d+)?",
    "nonNegativeInteger": r"\d+",
    "degrees": r"\d|[1-9]\d|[12]\d\d|3[0-5]\d",
    "measured": "trafficFlow|trafficConcentration|trafficHeadway|trafficSpeed",
    "status": "real|securityExercise|technicalExercise|test",
    "meaning": "beginTime|endTime|middleTime",
    "vehicle": "anyVehicle|bicycle|bus|car|lorry|motorcycle|trailer|tram|van|other",
}


def short(tag):
    """A name with its prefix."""
    space, _, name = tag[1:].partition("}")
    return next(f"{prefix}:{name}" for prefix, one in NAMES.items() if one == space)


def check(element, kind):
    """Hold an element against what the schema says of its type."""
    if kind.startswith("["):
        named = element.attrib[XSI]
        assert named in EXTENDS[kind], (element.tag, named)
        kind = named
    if kind in SIMPLE:
        assert re.fullmatch(SIMPLE[kind], element.text), (element.tag, element.text)
        assert not len(element)
        return
    allowed, required = ATTRIBUTES.get(kind, ({}, set()))
    given = {name: value for name, value in element.attrib.items() if name != XSI}
    assert required <= set(given) <= set(allowed), (element.tag, given)
    assert all(re.fullmatch(allowed[name], value) for name, value in given.items()), given
    children = list(element)
    for part in TYPES[kind]:
        count = 0
        while children and short(children[0].tag) == part.name:
            check(children.pop(0), part.kind)
            count += 1
        assert part.least <= count <= part.most, (element.tag, part.name, count)
    assert children == [], (element.tag, [child.tag for child in children])


def at(minute):
    """A time of the morning, on the clock of Bonn."""
    return datetime.fromisoformat(f"2026-11-27T07:{minute:02d}:00+01:00")


def interval(begin=30, count=3, rate=36.0, speed=50.0, headway=4.25, occupancy=12.5, **classes):
    """Five minutes of a station."""
    return SiteInterval(
        "gate-left", at(begin), at(begin + 5), 100.0, count, rate, occupancy, headway, speed, classes
    )


PUBLICATION = Publication(at(40), "DE", "city-of-bonn", "bridges")


def written(tmp_path, *intervals):
    """The publication of some intervals, read back."""
    path = tmp_path / "data.xml"
    write_datex2(intervals, PUBLICATION, path)
    root = ElementTree.parse(path).getroot()
    assert root.tag == f"{{{BASE}d2Payload}}payload"
    assert root.attrib[XSI] == "roa:MeasuredDataPublication"
    # Names in `xsi:type` are read by the prefixes of the file.
    spaces = {f'xmlns:{prefix}="{NAMES[prefix]}"' for prefix in ("com", "roa")}
    assert spaces <= set(path.read_text().split())
    check(root, "roa:MeasuredDataPublication")
    return root


def values(root, path):
    """Texts or attributes at a path."""
    return [one.text for one in root.findall(path, NAMES)]


def quantity(root, index, path):
    """What is at a path of a quantity, site by site."""
    return values(
        root, f".//roa:physicalQuantity[@index='{index}']/roa:physicalQuantity/roa:basicData/{path}"
    )


def test_all_that_is_known_is_there_as_the_schema_has_it(tmp_path):
    root = written(tmp_path, interval(car=2, truck=1), interval(35, 0, 0.0, car=0, truck=0))
    assert values(root, "com:publicationTime") == ["2026-11-27T07:40:00+01:00"]
    assert values(root, "com:publicationCreator/*") == ["DE", "city-of-bonn"]
    assert root.find("roa:measurementSiteTableReference", NAMES).attrib["id"] == "bridges"
    assert quantity(root, 1, "roa:vehicleFlow/com:vehicleFlowRate") == ["36", "0"]
    assert quantity(root, 2, "roa:occupancy/com:percentage") == ["12.5", "12.5"]
    assert quantity(root, 3, "roa:averageTimeHeadway/roa:duration") == ["4.25", "4.25"]
    assert quantity(root, 4, "roa:averageVehicleSpeed/com:speed") == ["50", "50"]
    times = ".//roa:measurementTimeDefault/roa:period/com:startOfPeriod"
    assert values(root, times) == ["2026-11-27T07:30:00+01:00", "2026-11-27T07:35:00+01:00"]


def test_flows_are_also_by_type_of_vehicle(tmp_path):
    """Twelve vehicles at 144 an hour; what a detector calls by a name of its own is `other`."""
    found = interval(count=12, rate=144.0, car=5, truck=3, motorbike=1, motorcycle=1, rickshaw=2)
    root = written(tmp_path, found)
    data = ".//roa:basicData[roa:forVehiclesWithCharacteristicsOf]"
    kinds = values(root, f"{data}/roa:forVehiclesWithCharacteristicsOf/com:vehicleType")
    rates = values(root, f"{data}/roa:vehicleFlow/com:vehicleFlowRate")
    counts = [one.attrib["numberOfInputValuesUsed"] for one in root.findall(f"{data}/roa:vehicleFlow", NAMES)]
    assert dict(zip(kinds, zip(counts, rates, strict=True), strict=True)) == {
        "anyVehicle": ("12", "144"),
        "car": ("5", "60"),
        "lorry": ("3", "36"),
        "motorcycle": ("2", "24"),
        "other": ("2", "24"),
    }


def test_what_was_not_measured_is_not_there_and_what_was_not_watched_is_an_error(tmp_path):
    nan = math.nan
    unknown = interval(count=0, rate=nan, speed=nan, headway=nan, occupancy=nan)
    root = written(tmp_path, unknown)
    assert [quantity(root, index, "*") for index in (2, 3, 4)] == [[], [], []]
    assert quantity(root, 1, "roa:vehicleFlow/com:dataError") == ["true"]


def test_the_same_bytes_again(tmp_path):
    for name in ("a.xml", "b.xml"):
        write_datex2([interval(car=3)], PUBLICATION, tmp_path / name)
    assert (tmp_path / "a.xml").read_bytes() == (tmp_path / "b.xml").read_bytes()


@pytest.mark.parametrize(
    "spoil",
    [
        lambda root: root.remove(root.find("roa:headerInformation", NAMES)),
        lambda root: root.insert(0, root.find("roa:siteMeasurements", NAMES)),
        lambda root: root.find(".//com:vehicleFlowRate", NAMES).__setattr__("text", "36.5"),
        lambda root: root.find(".//com:vehicleType", NAMES).__setattr__("text", "spaceship"),
    ],
)
def test_the_check_of_the_structure_finds_what_is_wrong(tmp_path, spoil):
    root = written(tmp_path, interval())
    spoil(root)
    with pytest.raises(AssertionError):
        check(root, "roa:MeasuredDataPublication")


def test_the_table_of_sites_is_as_the_schema_has_it_and_of_the_data(tmp_path):
    data = written(tmp_path, interval(car=2, truck=1), interval(35))
    places = {"gate": SitePlace(50.7353, 7.1002), "gate-left": SitePlace(50.7354, 7.1003, 271.6)}
    path = tmp_path / "sites.xml"
    write_sites([interval(car=2, truck=1), interval(35)], places, PUBLICATION, path)
    root = ElementTree.parse(path).getroot()
    assert root.attrib[XSI] == "roa:MeasurementSiteTablePublication"
    assert f'xmlns:loc="{NAMES["loc"]}"' in path.read_text()
    check(root, "roa:MeasurementSiteTablePublication")
    (site,) = root.findall("roa:measurementSiteTable/roa:measurementSite", NAMES)
    assert site.attrib["id"] == "gate-left"
    assert values(root, ".//loc:pointCoordinates/*") == ["50.7354000", "7.1003000"]
    assert values(root, ".//loc:bearing") == ["272"]
    # Each index of the data is explained.
    used = {one.attrib["index"] for one in data.findall(".//roa:physicalQuantity[@index]", NAMES)}
    told = {one.attrib["index"] for one in site.findall("roa:measurementSpecificCharacteristics", NAMES)}
    assert used == told == set("123456")
    kinds = values(root, ".//roa:specificVehicleCharacteristics/com:vehicleType")
    assert kinds == ["anyVehicle", "car", "lorry"]
    assert set(values(root, ".//roa:period")) == {"300"}


def test_places_are_read_and_found_by_the_longest_name(tmp_path):
    path = tmp_path / "places.csv"
    path.write_text("station,latitude,longitude,bearing\nnorth,50,7,\nnorth-left,51,8,90\n")
    places = read_places(path)
    assert place_of("north-left-lane1", places) == SitePlace(51.0, 8.0, 90.0)
    assert place_of("north-right", places).latitude == 50.0
    with pytest.raises(DataError, match="'south' has no place"):
        place_of("south", places)


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("a,91,7,", "latitude and"),
        ("a,50,7,400", "bearing"),
        ("north,50,7,", "twice"),
        ("a,x,7,", "latitude"),
    ],
)
def test_places_that_are_none_are_refused(row, words, tmp_path):
    path = tmp_path / "places.csv"
    path.write_text(f"station,latitude,longitude,bearing\nnorth,50,7,\n{row}\n")
    with pytest.raises(DataError, match=words) as error:
        read_places(path)
    assert ":3: " in str(error.value)
