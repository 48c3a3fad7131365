"""What a test can do to an encoder with the PROFIdrive interface (PD-349, C402-312)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from emulators.encoder._faults import EncoderFaults
from fieldbus.errors import UnsupportedFaultError

if TYPE_CHECKING:
    from emulators.encoder.profidrive.interface import EncoderInterface

NOT_VALID: Final = 0x0001


class SensorFaults(EncoderFaults):
    """Fault methods of one encoder with its interface. The owner has the attributes named here."""

    __slots__ = ()

    if TYPE_CHECKING:
        name: str
        interface: EncoderInterface

    def suppress_index(self, missing: bool) -> None:
        """Let the zero mark never come, or come again.

        Raises:
            UnsupportedFaultError: An absolute encoder has none.

        """
        if self.interface.form.absolute:
            raise UnsupportedFaultError(f"{self.name}: an absolute encoder has no index")
        self.encoder.zero_mark_present = not missing

    def set_encoder_error(self, code: int, active: bool) -> None:
        """Bring about the cause of an error of Gx_XIST2, or end it; see `EncoderInterface.set_error`.

        Raises:
            ConfigurationError: There is no such code.

        """
        if active:
            self.interface.set_error(code)
        else:
            self.interface.clear_error(code)

    def break_encoder_wire(self, broken: bool) -> None:
        """Cut its wire: the value stands, Gx_ZSW says so (0001h); or repair it."""
        self.encoder.freeze(broken)
        self.set_encoder_error(NOT_VALID, broken)
