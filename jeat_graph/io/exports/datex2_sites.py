"""The table of measurement sites as DATEX II v3: a `MeasurementSiteTablePublication`, beside measured data.

Each site has the identifier by which the data refer to it, what each index of its quantities is, and its
place: WGS 84 latitude and longitude in degrees, and the bearing of the traffic where it is known. Elements
and their order are those of the schema of version 3 (`RoadTrafficData`, `LocationReferencing`). Source:
https://docs.datex2.eu, CEN EN 16157-2 and -5.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from jeat_graph.data.errors import DataError
from jeat_graph.io.exports.datex2 import (
    FIRST_TYPE,
    SCHEMA,
    SITE_VERSION,
    Publication,
    SiteInterval,
    add_publication,
    add_text,
    root_of,
    types_of,
    write_payload,
)
from jeat_graph.io.tables.file_tables import read_table

_QUANTITIES = ("trafficFlow", "trafficConcentration", "trafficHeadway", "trafficSpeed")
_ANY = "anyVehicle"
_FULL_TURN = 360.0


class SitePlace(NamedTuple):
    """Where a station is: degrees of WGS 84, and the bearing of its traffic (degrees from north), or NaN."""

    latitude: float
    longitude: float
    bearing: float = math.nan


def read_places(path: str | Path) -> dict[str, SitePlace]:
    """Read `station, latitude, longitude` and optional `bearing`; a station may be that of one direction.

    Raises:
        DataError: names the line of a place that is none, or of a station that is there twice.
    """
    table = read_table(path, ("station", "latitude", "longitude"), ("bearing",))
    columns = [table.number("latitude"), table.number("longitude")]
    bearing = [math.nan] * len(table)
    if "bearing" in table:
        bearing = table.number("bearing", blank_ok=True).tolist()
    found: dict[str, SitePlace] = {}
    rows = zip(table.text("station").tolist(), *(c.tolist() for c in columns), bearing, strict=True)
    for row, (name, *numbers) in enumerate(rows):
        place = SitePlace(*numbers)
        if not (abs(place.latitude) <= 90.0 and abs(place.longitude) <= 180.0):
            raise table.error(row, "latitude and longitude must be degrees, from −90 to 90 and −180 to 180")
        if not (math.isnan(place.bearing) or 0.0 <= place.bearing < _FULL_TURN):
            raise table.error(row, f"bearing must be degrees from 0 to 360, got {place.bearing:g}")
        if name in found:
            raise table.error(row, f"station {name!r} is there twice")
        found[name] = place
    return found


def place_of(site: str, places: Mapping[str, SitePlace]) -> SitePlace:
    """Return the place of a site: that of the longest station whose name its own begins with.

    Raises:
        DataError: there is none.
    """
    parts = site.split("-")
    for count in range(len(parts), 0, -1):
        if (name := "-".join(parts[:count])) in places:
            return places[name]
    raise DataError(f"the site {site!r} has no place: {', '.join(places) or 'none'} have one")


def write_sites(
    intervals: Sequence[SiteInterval],
    places: Mapping[str, SitePlace],
    publication: Publication,
    path: str | Path,
) -> None:
    """Write the table of the sites that some data are of; the same input gives the same bytes.

    Args:
        intervals: the data.
        places: of `read_places`.
        publication: of the data, which names the table.
        path: the file.

    Raises:
        DataError: a site has no place, or the file cannot be written.
    """
    root = root_of("MeasurementSiteTablePublication", {"xmlns:loc": f"{SCHEMA}/locationReferencing"})
    add_publication(root, publication)
    header = ElementTree.SubElement(root, "roa:headerInformation")
    add_text(header, "com:informationStatus", "real")
    about = {"id": publication.table, "version": SITE_VERSION}
    table = ElementTree.SubElement(root, "roa:measurementSiteTable", about)
    types = types_of(intervals)
    sites = {one.site: (one.end - one.begin).total_seconds() for one in intervals}
    for site, period_s in sorted(sites.items()):
        _add_site(table, site, place_of(site, places), types, period_s)
    write_payload(root, path)


def _add_site(
    table: ElementTree.Element, site: str, place: SitePlace, types: Sequence[str], period_s: float
) -> None:
    one = ElementTree.SubElement(table, "roa:measurementSite", {"id": site, "version": SITE_VERSION})
    values = ElementTree.SubElement(ElementTree.SubElement(one, "roa:measurementSiteName"), "com:values")
    name = ElementTree.SubElement(values, "com:value", {"lang": "en"})
    name.text = site
    quantities = [(kind, _ANY if k == 0 else "") for k, kind in enumerate(_QUANTITIES)]
    assert len(quantities) == FIRST_TYPE - 1
    quantities += [(_QUANTITIES[0], kind) for kind in types]
    for index, (kind, vehicles) in enumerate(quantities, 1):
        outer = ElementTree.SubElement(one, "roa:measurementSpecificCharacteristics", {"index": str(index)})
        inner = ElementTree.SubElement(outer, "roa:measurementSpecificCharacteristics")
        add_text(inner, "roa:period", f"{period_s:g}")
        add_text(inner, "roa:specificMeasurementValueType", kind)
        if vehicles:
            characteristics = ElementTree.SubElement(inner, "roa:specificVehicleCharacteristics")
            add_text(characteristics, "com:vehicleType", vehicles)
    point = {"xsi:type": "loc:PointLocation"}
    location = ElementTree.SubElement(one, "roa:measurementSiteLocation", point)
    at = ElementTree.SubElement(location, "loc:pointByCoordinates")
    if not math.isnan(place.bearing):
        add_text(at, "loc:bearing", f"{round(place.bearing) % int(_FULL_TURN)}")
    coordinates = ElementTree.SubElement(at, "loc:pointCoordinates")
    add_text(coordinates, "loc:latitude", f"{place.latitude:.7f}")
    add_text(coordinates, "loc:longitude", f"{place.longitude:.7f}")
