"""What the connection is made of, each part alone: pace, parser, turns, crowd."""

import asyncio
import select
import socket
from dataclasses import dataclass
from ipaddress import ip_network
from math import inf

import h11
import pytest

from service.http.addresses import is_named, site
from service.http.connection import outlet as outlet_module
from service.http.connection.crowd import Crowd
from service.http.connection.deadline import Deadline
from service.http.connection.outlet import TELLS_END, Outlet
from service.http.connection.pace import Pace
from service.http.connection.parser import BYTES_A_PIECE, FREE_PIECES, Parser
from service.http.connection.turns import Turns

PACE = Pace(rate=100, grace=10, idle=4, whole=60)
CHUNKED = b"POST / HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n"


@pytest.mark.parametrize(
    ("moved", "waited", "patience", "excuse"),
    [
        (0, 0, 4, "nothing for 4 seconds"),
        (0, 8, 2, None),
        (0, 10, 0, "slower than 100 bytes a second"),
        (100, 10, 1, None),
        (10_000, 59, 1, None),
        (10_000, 60, 0, "not whole within 60 seconds"),
    ],
)
def test_a_client_may_be_late_but_not_slow(moved, waited, patience, excuse):
    assert PACE.patience(moved, waited) == patience
    if excuse is not None:
        assert PACE.excuse(moved, waited) == excuse


def test_a_deadline_comes_once_unless_it_is_stopped_and_may_run_again():
    async def scenario():
        came = []
        deadline = Deadline(asyncio.get_running_loop(), lambda: came.append(1))
        deadline.start(0)
        deadline.start(0)
        await asyncio.sleep(0.001)
        first = len(came)
        deadline.start(0)
        deadline.stop()
        await asyncio.sleep(0.001)
        stopped = len(came)
        deadline.start(0)
        await asyncio.sleep(0.001)
        return first, stopped, len(came)

    assert asyncio.run(scenario()) == (1, 1, 2)


def events(parser, most):
    parser.breathe(most)
    seen = []
    while (event := parser.next_event()) is not h11.NEED_DATA:
        seen.append(event)
    return seen


def test_a_read_full_of_small_chunks_is_parsed_in_turns():
    parser = Parser(2**14)
    parser.receive_data(CHUNKED + b"1\r\nx\r\n" * 100)
    assert len(events(parser, 32)) == 32
    assert parser.out_of_breath
    assert len(events(parser, 1000)) == 69
    assert not parser.out_of_breath


def test_a_body_in_countless_pieces_is_a_flood():
    parser = Parser(2**14)
    parser.receive_data(CHUNKED + b"1\r\nx\r\n" * FREE_PIECES)
    events(parser, 10**6)
    assert not parser.flooded
    parser.receive_data(b"1\r\nx\r\n" * 10)
    assert len(events(parser, 10**6)) == 1
    assert parser.flooded
    assert parser.next_event() is h11.NEED_DATA


def test_pieces_of_ordinary_size_are_no_flood():
    parser = Parser(2**14)
    parser.receive_data(CHUNKED)
    for _ in range(4 * FREE_PIECES):
        parser.receive_data(b"%x\r\n" % BYTES_A_PIECE + bytes(BYTES_A_PIECE) + b"\r\n")
        events(parser, 10)
    assert not parser.flooded


def test_a_content_length_body_has_no_pieces():
    parser = Parser(2**14)
    parser.receive_data(b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000\r\n\r\n")
    for _ in range(1000):
        parser.receive_data(b"x")
        events(parser, 10)
    assert not parser.flooded


def test_a_refusal_keeps_the_status_that_the_parser_gave():
    parser = Parser(1000)
    parser.receive_data(b"GET / HTTP/1.1\r\nX: " + b"x" * 2000)
    with pytest.raises(h11.RemoteProtocolError):
        events(parser, 10)
    assert parser.status_hint == 431


@pytest.mark.parametrize(
    ("target", "path", "host"),
    [
        (b"/limits?x=http://b/", b"/limits?x=http://b/", b"a"),
        (b"*", b"*", b"a"),
        (b"http://b/limits?x=1", b"/limits?x=1", b"b"),
        (b"HTTPS://b.example:8000/", b"/", b"b.example:8000"),
        (b"http://[2001:db8::1]:80/limits", b"/limits", b"[2001:db8::1]:80"),
        (b"http://b", b"/", b"b"),
        (b"http://b?x=1", b"/?x=1", b"b"),
        (b"http://b//c/d", b"//c/d", b"b"),
        (b"ftp://b/limits", b"ftp://b/limits", b"a"),
    ],
)
def test_a_target_with_a_host_is_its_path_and_its_host_is_the_requests(target, path, host):
    parser = Parser(2**14)
    parser.receive_data(b"GET %b HTTP/1.1\r\nX: y\r\nHost: localhost\r\n\r\n" % target)
    request, _ = events(parser, 10)
    assert request.target == path
    assert [value for name, value in request.headers if name == b"host"] == [host]
    assert (b"x", b"y") in list(request.headers)


def test_each_turn_of_the_loop_takes_one_step():
    async def run():
        turns, order = Turns(), []
        left = {"a": 3, "b": 2}

        def step(name):
            order.append(name)
            left[name] -= 1
            if left[name]:
                turns.add(steps[name])

        steps = {name: (lambda name=name: step(name)) for name in left}
        turns.add(steps["a"])
        turns.add(steps["a"])
        turns.add(steps["b"])
        for _ in range(10):
            await asyncio.sleep(0)
            order.append("|")
        return "".join(order).strip("|")

    assert asyncio.run(run()) == "a|b|a|b|a"


def test_a_step_that_leaves_is_not_called():
    async def run():
        turns, called = Turns(), []
        gone, kept = (lambda: called.append("gone")), (lambda: called.append("kept"))
        turns.add(gone)
        turns.add(kept)
        turns.remove(gone)
        for _ in range(4):
            await asyncio.sleep(0)
        turns.add(gone)
        turns.remove(gone)
        await asyncio.sleep(0)
        return called

    assert asyncio.run(run()) == ["kept"]


@pytest.mark.parametrize(
    ("address", "name"),
    [
        ("192.0.2.7", "192.0.2.7"),
        ("::ffff:192.0.2.7", "192.0.2.7"),
        ("2001:db8::1", "2001:db8::/64"),
        ("2001:db8::ffff:0:1", "2001:db8::/64"),
        ("2001:db8:0:1::1", "2001:db8:0:1::/64"),
        ("not an address", "not an address"),
    ],
)
def test_an_ipv6_client_is_its_network(address, name):
    assert site(address) == name


def test_only_addresses_inside_the_networks_are_named():
    networks = (ip_network("10.0.0.0/8"), ip_network("2001:db8::/32"))
    inside = ["10.1.2.3", "::ffff:10.1.2.3", "2001:db8::1"]
    outside = ["11.0.0.1", "::1", "", "10.1.2.3, 10.1.2.4", "unknown"]
    assert [is_named(address, networks) for address in inside + outside] == [True] * 3 + [False] * 5


@dataclass(eq=False)
class Guest:
    """A connection as the crowd sees it."""

    idle: bool = True
    speed: float = inf
    ended: bool = False
    left: bool = False

    def is_idle(self):
        return self.idle

    def has_left(self):
        return self.left

    def rate(self):
        return self.speed

    def give_way(self):
        self.ended = True


def entered(crowd, *guests, addresses="abcdefgh"):
    for guest, address in zip(guests, addresses, strict=False):
        assert crowd.enter(guest, address) is None
    return guests


def test_an_address_has_its_share_and_a_proxy_has_none():
    crowd = Crowd(most=10, most_of_address=2, proxies=(ip_network("10.0.0.1/32"),))
    first, _ = entered(crowd, Guest(), Guest(), addresses="aa")
    assert "2 connections of your address" in crowd.enter(Guest(), "a")
    assert crowd.enter(Guest(), "b") is None
    assert [crowd.enter(Guest(), "10.0.0.1") for _ in range(3)] == [None] * 3
    assert (len(crowd), crowd.refused) == (6, 1)
    crowd.leave(first)
    crowd.leave(first)
    assert len(crowd) == 5
    assert crowd.enter(Guest(), "a") is None


def test_in_a_full_share_the_oldest_whose_client_has_left_gives_way_to_its_own_address_alone():
    crowd = Crowd(most=10, most_of_address=3)
    stays, left, left_too, other = entered(
        crowd, Guest(), Guest(left=True), Guest(left=True), Guest(left=True), addresses="aaab"
    )
    assert crowd.enter(Guest(), "a") is None
    assert crowd.enter(Guest(), "a") is None
    assert "3 connections of your address" in crowd.enter(Guest(), "a")
    assert [guest.ended for guest in (stays, left, left_too, other)] == [False, True, True, False]


def test_in_a_full_share_who_has_asked_does_not_give_way_but_who_listens_no_more():
    """A client may end what it sends and wait for its answer, or still take it."""
    crowd = Crowd(most=10, most_of_address=3)
    works, takes, listens = entered(
        crowd, Guest(left=True), Guest(left=True), Guest(left=True), addresses="aaa"
    )
    crowd.work(works)
    crowd.attend(takes)
    crowd.listen(listens)
    assert crowd.enter(Guest(), "a") is None
    assert "3 connections of your address" in crowd.enter(Guest(), "a")
    assert [works.ended, takes.ended, listens.ended] == [False, False, True]


def test_who_has_waited_longest_gives_way():
    crowd = Crowd(most=3, most_of_address=1)
    first, second, third = entered(crowd, Guest(), Guest(), Guest())
    crowd.work(first)
    entered(crowd, Guest(idle=False), addresses="x")
    assert (first.ended, second.ended, third.ended) == (False, True, False)
    crowd.leave(second)
    entered(crowd, Guest(idle=False), addresses="y")
    assert (first.ended, third.ended) == (False, True)
    crowd.leave(third)
    assert "3 connections are open" in crowd.enter(Guest(), "z")


def test_who_has_said_something_that_is_not_read_yet_does_not():
    crowd = Crowd(most=2, most_of_address=1)
    first, second = entered(crowd, Guest(idle=False), Guest())
    assert crowd.enter(Guest(), "x") is None
    assert (first.ended, second.ended) == (False, True)


def test_where_nobody_waits_the_slowest_gives_way():
    crowd = Crowd(most=3, most_of_address=1)
    guests = entered(crowd, Guest(speed=1e6), Guest(speed=3), Guest(speed=inf))
    for guest in guests:
        crowd.attend(guest)
    entered(crowd, Guest(idle=False), addresses="x")
    assert [guest.ended for guest in guests] == [False, True, False]
    crowd.leave(guests[1])
    crowd.work(guests[0])
    # Of the last one it is too early to tell.
    assert "3 connections are open" in crowd.enter(Guest(), "y")


def test_of_equally_slow_ones_the_oldest_of_the_greediest_address_gives_way():
    crowd = Crowd(most=4, most_of_address=3)
    guests = entered(crowd, *(Guest(speed=0) for _ in range(4)), addresses="abbb")
    for guest in guests:
        crowd.attend(guest)
    assert crowd.enter(Guest(), "c") is None
    assert [guest.ended for guest in guests] == [False, True, False, False]


def test_of_streams_that_of_the_greediest_address_gives_way_before_anyone_slow():
    crowd = Crowd(most=4, most_of_address=3)
    guests = entered(crowd, *(Guest(speed=0) for _ in range(4)), addresses="acbb")
    crowd.attend(guests[0])
    for guest in guests[1:]:
        crowd.listen(guest)
    assert crowd.enter(Guest(), "d") is None
    assert [guest.ended for guest in guests] == [False, False, True, False]


def test_a_burst_whose_heads_are_not_read_yet_gives_way_by_address():
    crowd = Crowd(most=4, most_of_address=3)
    guests = entered(crowd, *(Guest(idle=False) for _ in range(4)), addresses="abbb")
    assert crowd.enter(Guest(), "c") is None
    assert [guest.ended for guest in guests] == [False, True, False, False]


def test_of_a_burst_only_the_oldest_are_asked_whether_they_are_idle():
    crowd = Crowd(most=1000, most_of_address=1000)
    asked = []

    class Asked(Guest):
        def is_idle(self):
            asked.append(self)
            return False

    entered(crowd, *(Asked() for _ in range(1000)), addresses="a" * 1000)
    assert crowd.enter(Guest(), "b") is None
    assert 0 < len(asked) < 100


def test_who_rests_again_gives_way_as_one_who_rests():
    crowd = Crowd(most=2, most_of_address=1)
    resting, slow = entered(crowd, Guest(), Guest(speed=1))
    crowd.attend(resting)
    crowd.attend(slow)
    crowd.wait(resting)
    assert crowd.enter(Guest(), "x") is None
    assert (resting.ended, slow.ended) == (True, False)


def test_where_all_are_served_the_greediest_address_gives_way_to_one_that_has_less():
    crowd = Crowd(most=4, most_of_address=3)
    guests = entered(crowd, *(Guest() for _ in range(4)), addresses="abbb")
    for guest in guests:
        crowd.work(guest)
    late = Guest()
    assert crowd.enter(late, "c") is None
    assert [guest.ended for guest in guests] == [False, True, False, False]
    crowd.leave(guests[1])
    crowd.work(late)
    # Now nobody has more than one who came would have.
    assert "4 connections are open" in crowd.enter(Guest(), "c")


def test_a_burst_whose_pace_is_not_yet_known_gives_way_by_address():
    crowd = Crowd(most=4, most_of_address=3)
    guests = entered(crowd, *(Guest() for _ in range(4)), addresses="abbb")
    for guest in guests:
        crowd.attend(guest)
    assert crowd.enter(Guest(), "c") is None
    assert [guest.ended for guest in guests] == [False, True, False, False]


def test_a_proxys_requests_never_give_way_to_a_stranger():
    crowd = Crowd(most=3, most_of_address=1, proxies=(ip_network("10.0.0.1/32"),))
    guests = entered(crowd, *(Guest() for _ in range(3)), addresses=["10.0.0.1"] * 3)
    for guest in guests:
        crowd.work(guest)
    assert "3 connections are open" in crowd.enter(Guest(), "a")


class Ends:
    """A transport, as far as an outlet asks it for its socket."""

    def __init__(self, opened):
        self.opened = opened

    def get_extra_info(self, name):
        assert name == "socket"
        return self.opened


@pytest.mark.parametrize(
    ("said", "leaves", "unread"),
    [(b"", False, False), (b"GET", False, True), (b"", True, False), (b"GET", True, True)],
)
def test_who_has_left_without_a_word_has_nothing_unread(said, leaves, unread):
    ours, theirs = socket.socketpair()
    with ours, theirs:
        ours.setblocking(False)
        theirs.sendall(said)
        if leaves:
            theirs.close()
        outlet = Outlet(Ends(ours), lambda: None)
        assert outlet.has_unread is unread
        # It was looked at, not taken.
        assert (ours.recv(10) if said else said) == said


@pytest.mark.parametrize("seconds", [1e-9, 30, 1e306])
def test_whatever_the_wait_for_a_client_is_the_system_is_told_of_one(seconds):
    with socket.create_server(("127.0.0.1", 0)) as server:
        Outlet(Ends(server), lambda: None).keep_little(seconds)
        told = server.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT)
        assert told == {1e-9: 1, 30: 30_000, 1e306: 2**31 - 1}[seconds]


def test_where_no_look_can_be_told_not_to_wait_nothing_is_unread(monkeypatch):
    """As on Windows."""
    monkeypatch.setattr(outlet_module, "DOES_NOT_WAIT", None)
    monkeypatch.delattr(socket, "MSG_DONTWAIT")
    ours, theirs = socket.socketpair()
    with ours, theirs:
        theirs.sendall(b"GET")
        assert Outlet(Ends(ours), lambda: None).has_unread is False


@pytest.mark.skipif(not TELLS_END, reason="the system does not tell before all is read")
@pytest.mark.parametrize("said", [b"", b"GET / HTTP/1.1\r\n\r\n"])
@pytest.mark.parametrize("leaves", [False, True])
def test_who_has_left_is_seen_behind_what_it_said(said, leaves):
    """Over TCP, as clients come."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        theirs = socket.create_connection(server.getsockname())
        ours, _ = server.accept()
        with theirs, ours:
            theirs.sendall(said)
            if leaves:
                theirs.close()
                come = select.poll()
                come.register(ours.fileno(), select.POLLRDHUP)
                come.poll()
            assert Outlet(Ends(ours), lambda: None).has_left is leaves
