"""A cached property is computed once an instance, and no instance waits for another."""

from threading import Event, Thread

from pns_common.base.cached import cached_property


class Holder:
    """Computes something that may take long."""

    def __init__(self, go: Event | None = None):
        self.go, self.asked = go, Event()
        self.times = 0

    @cached_property
    def value(self) -> int:
        """How often it was computed."""
        self.asked.set()
        if self.go is not None:
            self.go.wait()
        self.times += 1
        return self.times


def test_it_is_computed_once():
    holder = Holder()
    assert (holder.value, holder.value) == (1, 1)
    assert isinstance(Holder.value, cached_property)


def test_no_instance_waits_for_another():
    go = Event()
    slow = Holder(go)
    threads = [Thread(target=getattr, args=(each, "value")) for each in (slow, Holder())]
    try:
        threads[0].start()
        slow.asked.wait()
        threads[1].start()
        threads[1].join(10)
        assert not threads[1].is_alive()
    finally:
        go.set()
        for thread in threads:
            thread.join()
    assert slow.value == 1
