"""Root of every exception that this product raises on purpose."""


class HilError(Exception):
    """Base of all exceptions of the product; catching it catches nothing of third parties."""


class ConfigurationError(HilError):
    """A value given by the user cannot be used.

    The message names where the value stands, the value, and what is allowed.

    Args:
        where: File, key path or parameter name.
        value: The offending value as given.
        allowed: What would have been accepted, in words.

    """

    def __init__(self, where: str, value: object, allowed: str) -> None:
        super().__init__(f"{where}: {value!r} is not allowed; allowed: {allowed}")
        self.where = where
        self.value = value
        self.allowed = allowed


class SchedulerError(HilError):
    """Misuse of a scheduler, such as an event in the past."""


class BusError(HilError):
    """A bus or one of its ports cannot do what was asked."""


class UnsupportedFaultError(HilError):
    """The present bench cannot inject this fault; the message says why (verdict: blocked)."""
