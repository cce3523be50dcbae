"""Addresses of brokers: taken apart, refused with what is right, and never shown with a password."""

from __future__ import annotations

import copy
import pickle
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st
from paho.mqtt.client import topic_matches_sub

from jeat_graph.cli.main import main
from jeat_graph.data.errors import ConfigError
from jeat_graph.data.secrets import Secret, shown_url, without_logins
from jeat_graph.live.transport.address import parse_address
from jeat_graph.live.transport.brokers.mqtt import BROKER as MQTT
from jeat_graph.live.transport.ends import check_addresses, sink_address, source_address
from jeat_graph.live.transport.names import distinct_name

WRONG = [
    ("amqp://host/topic", "is no address of a broker"),
    ("broker/topic", "is no address of a broker"),
    ("", "is no address of a broker"),
    ("mqtt://host", "names no topic"),
    ("mqtt://host/", "names no topic"),
    ("nats:///topic", "names no host"),
    ("nats:topic", "names no host"),
    ("mqtt://user@/topic", "names no host"),
    ("mqtt://:1883/topic", "names no host"),
    ("mqtt://[::1/road", "the host is no name and no number"),
    ("mqtt://::1/road", "names no host"),
    ("mqtt://[zz]/road", "the host is no name and no number"),
    ("mqtt://[]/road", "names no host|the host is no name"),
    ("mqtt://a..b/road", "the host is no name and no number"),
    ("mqtt://a b/road", "the host is no name and no number"),
    ("mqtt://-a/road", "the host is no name and no number"),
    (f"mqtt://{'a' * 64}/road", "the host is no name and no number"),
    (f"mqtt://{'a.' * 127}a/road", "the host is no name and no number"),
    ("kafka://host1:9092,host2:9092/topic", "the port is no number|the host is no name"),
    ("kafka://host:x/topic", "the port is no number"),
    ("mqtt://host:0/topic", "the port is no number from 1 to 65535"),
    ("mqtt://host:-1/topic", "the port is no number from 1 to 65535"),
    ("mqtt://host:65536/topic", "the port is no number from 1 to 65535"),
    ("mqtt://host:99999999999999999999/topic", "the port is no number from 1 to 65535"),
    ("mqtt://ho\nst/topic", "control characters"),
    ("mqtt://host/to%0Apic", "control characters"),
    ("mqtt://host/to%00pic", "control characters"),
    ("mqtt://host/a/b#", "'#' for all that follow"),
    ("mqtt://host/a/#/b", "'#' for all that follow"),
    ("mqtt://host/a+/b", "a whole level"),
    ("mqtt://host/$share/group", r"a shared subscription is \$share/GROUP/TOPIC"),
    ("mqtt://host/$share/+/a", r"a shared subscription is \$share/GROUP/TOPIC"),
    (f"mqtt://host/{'a' * 65536}", "65535 bytes at most"),
    ("nats://host/a..b", "words between its dots"),
    ("nats://host/a.", "words between its dots"),
    ("nats://host/a%20b", "words between its dots"),
    ("nats://host/>.a", "'>' may only be the last word"),
    ("kafka://host/a/b", "a topic of Kafka"),
    ("kafka://host/..", "a topic of Kafka"),
    ("kafka://host/^a", "a topic of Kafka"),
    (f"kafka://host/{'a' * 250}", "a topic of Kafka"),
    ("mqtt://host/topic?qos=2", "unknown option 'qos'"),
    ("mqtt://host/topic?client=a&client=b", "client is given twice"),
    ("mqtt://host/topic?client=", "client has no value"),
    ("nats://host/topic?durable=a.b", "durable has no value that the broker takes"),
    ("nats://host/topic?stream=a%20b", "stream has no value that the broker takes"),
]


@pytest.mark.parametrize(("address", "message"), WRONG)
def test_an_address_that_is_wrong_is_refused_with_what_is_right(address, message):
    with pytest.raises(ConfigError, match=message):
        source_address(address)


@pytest.mark.parametrize("end", ["--source", "--sink"])
@pytest.mark.parametrize("address", [address for address, _ in WRONG])
def test_the_command_says_so_in_one_line_and_ends_with_2(end, address, capsys):
    assert main(["stream", end, address]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert len(said.err.splitlines()) == 1
    assert said.err.startswith("jeat-graph stream: ")


@pytest.mark.parametrize("most", ["0", "-1", "x", "inf", "nan", "1e999", "65536", "9" * 5000])
def test_a_number_of_open_messages_is_one_that_brokers_take(most):
    with pytest.raises(ConfigError, match="most must be a number from 1 to 65535"):
        source_address(f"mqtt://host/topic?most={most}").number("most", 20, low=1)


def test_an_address_is_taken_apart():
    address = parse_address("mqtt://me:s%3Acret@host:99/a/+/#?client=c", ("client",))
    assert (address.scheme, address.host, address.port, address.topic) == ("mqtt", "host", 99, "a/+/#")
    assert (address.user, address.password) == (Secret("me"), Secret("s:cret"))
    assert address.options == {"client": "c"}


@pytest.mark.parametrize(
    ("url", "server"),
    [
        ("mqtt://[::1]/t", "[::1]:1883"),
        ("nats://[fe80::1]:99/t", "[fe80::1]:99"),
        ("KAFKA://Host.example./t", "host.example.:9092"),
        ("mqtt://10.0.0.1:/t", "10.0.0.1:1883"),
        ("mqtt://straße.example/t", "straße.example:1883"),
    ],
)
def test_a_server_is_named_as_its_client_wants_it(url, server):
    assert source_address(url).server == server


class TestPasswords:
    def test_no_way_to_show_an_address_shows_them(self):
        address = source_address("mqtt://me:hunter2@host/t")
        for shown in (str(address), repr(address), f"{address}", repr([address]), str(vars(address))):
            assert "hunter2" not in shown
            assert "me:" not in shown
        assert address.password.reveal() == "hunter2"
        assert address.user.reveal() == "me"

    def test_they_are_not_written_to_files(self):
        with pytest.raises(TypeError, match="a secret is not written"):
            pickle.dumps(source_address("mqtt://me:hunter2@host/t"))
        with pytest.raises(TypeError, match="a secret is not written"):
            copy.deepcopy(Secret("hunter2"))

    def test_from_the_environment(self, monkeypatch):
        monkeypatch.setenv("ROAD_USER", "me")
        monkeypatch.setenv("ROAD_PASSWORD", "p@ss:%41/w#rd")
        address = source_address("mqtt://${ROAD_USER}-7:${ROAD_PASSWORD}@host/t")
        assert address.user.reveal() == "me-7"
        assert address.password.reveal() == "p@ss:%41/w#rd"  # as it is: nothing in it has to be escaped

    def test_a_variable_that_is_not_set_is_named(self, monkeypatch):
        monkeypatch.delenv("ROAD_PASSWORD", raising=False)
        with pytest.raises(ConfigError, match="the environment variable ROAD_PASSWORD is not set"):
            source_address("mqtt://me:${ROAD_PASSWORD}@host/t")
        with pytest.raises(ConfigError, match=r"a variable is written \$\{NAME\}") as error:
            source_address("mqtt://me:hunter2${1}@host/t")
        assert "hunter2" not in str(error.value)

    @pytest.mark.parametrize("end", ["", "\n", "\r\n"])
    def test_from_a_file(self, end, tmp_path):
        (tmp_path / "secret").write_bytes(f"p@ss wörd{end}".encode())
        address = source_address(f"nats://me@host/t?password_file={tmp_path}/secret&most=3")
        assert address.password.reveal() == "p@ss wörd"
        assert address.options == {"most": "3"}

    @pytest.mark.parametrize(
        "content", [b"", b"\n", b"hunter2\nhunter3\n", b"hunter2\x00", b"\xffhunter2", b"x" * 5000]
    )
    def test_a_file_that_holds_no_password_is_refused_without_its_content(self, content, tmp_path):
        (tmp_path / "secret").write_bytes(content)
        with pytest.raises(ConfigError, match="must hold one line, the password") as error:
            source_address(f"nats://me@host/t?password_file={tmp_path}/secret")
        assert "hunter" not in str(error.value)

    def test_a_file_that_is_not_there_is_named(self, tmp_path):
        with pytest.raises(ConfigError, match=r"password_file: .*/none: No such file"):
            source_address(f"nats://me@host/t?password_file={tmp_path}/none")
        with pytest.raises(ConfigError, match="Is a directory"):
            source_address(f"nats://me@host/t?password_file={tmp_path}")

    @pytest.mark.parametrize("login", ["", "me:hunter2@"])
    def test_a_file_goes_with_a_user_and_without_a_password(self, login, tmp_path):
        (tmp_path / "secret").write_text("hunter3")
        with pytest.raises(ConfigError, match="goes with a user and without a password") as error:
            source_address(f"nats://{login}host/t?password_file={tmp_path}/secret")
        assert "hunter" not in str(error.value)

    @pytest.mark.parametrize(
        "url",
        [
            "mqtt://me:hunter2/a@host/t",
            "mqtt://me:12/hunter2@host/t",
            "mqtt://me:12?hunter2@host/t",
            "mqtt://me:hunter2?a@host/t",
            "mqtt://me:a@hunter2@host:x/t",
            "mqtt://me:hunter2/t",
            "mqtt:me:hunter2@host/t",
            "mqtt:/me:hunter2@host/t",
            "me:hunter2@host/t",
            "amqp://me:hunter2@host/t",
            "mqtt://me:hunter2@[::1/t",
            "mqtt://me:hunter2 @a b/t",
            "mqtt://me:hunter2\n@host/t",
            "mqtt://me:hunter2@host",
            "mqtt://me:hunter2@host/t?password=hunter2",
            "mqtt://host:x/t?password=hunter2",
            "mqtt://me:%ZZhunter2@host/a/#/b",
        ],
    )
    def test_a_wrong_address_is_refused_without_them(self, url, capsys):
        with pytest.raises(ConfigError) as error:
            source_address(url)
        assert "hunter2" not in str(error.value)
        assert main(["stream", "--source", url]) == 2
        assert "hunter2" not in capsys.readouterr().err

    @given(st.text(st.characters(exclude_categories=["Cs"]), min_size=1))
    def test_no_text_in_place_of_one_is_shown(self, password):
        marker = f"hunter2{password}hunter2"
        try:
            shown = str(source_address(f"mqtt://me:{marker}@host/t"))
        except ConfigError as error:
            shown = str(error)
        assert "hunter2" not in shown

    def test_a_long_text_is_looked_through_in_no_time(self):
        begin = time.perf_counter()
        for text in ("a" * 10**6, "a:/" * 10**6, "a://b@" * 10**6):
            without_logins(text)
        assert time.perf_counter() - begin < 20.0  # a second; not the hours of looking anew from each sign

    def test_a_text_is_shown_without_the_logins_of_its_urls(self):
        assert without_logins("no file mqtt://me:a/b@h/t and me@h") == "no file mqtt://***@h/t and me@h"
        assert shown_url("nats://token@h:4222/s?stream=x") == "nats://***@h:4222/s"


class TestTwoEnds:
    @pytest.mark.parametrize(
        ("source", "sink"),
        [
            ("mqtt://h/a", "mqtt://h/a"),
            ("mqtt://h/a/#", "mqtt://me@h:1883/a/tracks"),
            ("mqtt://h/$share/g/+/t", "mqtt://h/a/t"),
            ("nats://h/a.*", "nats://h/a.b"),
            ("kafka://h/a", "kafka://h/a"),
        ],
    )
    def test_tracks_that_would_come_back_as_scans_are_refused(self, source, sink):
        with pytest.raises(ConfigError, match="would come back as scans"):
            check_addresses(source, sink)

    def test_one_name_for_both_ends_at_an_mqtt_broker_is_refused(self):
        with pytest.raises(ConfigError, match="names must differ"):
            check_addresses("mqtt://h/a?client=c", "mqtt://h/b?client=c")
        check_addresses("mqtt://h/a?client=c", "mqtt://other/b?client=c")

    def test_tracks_go_to_no_wild_card(self):
        for url in ("mqtt://host/a/#", "mqtt://host/+", "nats://host/a.*", "nats://host/>"):
            with pytest.raises(ConfigError, match="wild cards"):
                sink_address(url)


TOPICS = st.text("ab", max_size=2)


@given(
    st.lists(TOPICS | st.just("+"), min_size=1, max_size=4),
    st.booleans(),
    st.lists(TOPICS, min_size=1, max_size=4),
)
def test_what_a_subscription_of_mqtt_covers_is_what_its_client_says(levels, rest, topic):
    wanted = "/".join([*levels, "#"] if rest else levels)
    assert MQTT.covers(wanted, "/".join(topic)) == topic_matches_sub(wanted, "/".join(topic))


@given(st.lists(st.text(), min_size=1, max_size=3), st.lists(st.text(), min_size=1, max_size=3))
def test_two_things_at_a_broker_never_share_a_name(one, other):
    if one != other:
        assert distinct_name(*one) != distinct_name(*other)
    assert distinct_name(*one).replace("-", "").replace("_", "").isalnum()
    assert distinct_name(*one).isascii()
    assert len(distinct_name(*one)) <= 64


def test_names_that_look_alike_are_apart():
    alike = ["a/b", "a-b", "a.b", "A/b", "a b", "ä/b", "a/b/"]
    assert len({distinct_name(name).casefold() for name in alike}) == len(alike)
