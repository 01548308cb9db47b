import gc
import weakref

from shadowbench.per_device import once_per_device


class _Host:
    pass


def test_a_value_is_made_once_for_each_device_and_goes_with_its_host():
    made = []

    @once_per_device
    def copy(host, device):
        made.append(device)
        return object()

    host = _Host()
    assert copy(host, "cpu") is copy(host, "cpu")
    assert copy(host, "cuda:0") is not copy(host, "cpu")
    assert made == ["cpu", "cuda:0"]
    value, gone = weakref.ref(host), copy(_Host(), "cpu")
    assert gone is not None
    del host
    gc.collect()
    assert value() is None
