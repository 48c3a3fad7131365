"""The buses: decoded frames, one bit by bit, and the objects of the nodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from fieldbus.canopen.sdo_client import SdoJob
from hil.cockpit.bus_view import MOST_ROWS, BusView
from hil.cockpit.messages import Message, MessageError
from hil.cockpit.pane import Handler, Pane
from hil.cockpit.parameter_rows import parameter_text, parameter_value
from hil.cockpit.steps import ParameterTransfer, WriteObject, WriteParameter, parameter_port

if TYPE_CHECKING:
    from hil.bench.bench import Bench
    from hil.cockpit.client import Client
    from hil.cockpit.session import Session

_Name = Annotated[str, Field(min_length=1, max_length=80)]
_Index = Annotated[int, Field(ge=0, le=0xFFFF)]
_Sub = Annotated[int, Field(ge=0, le=0xFFFF)]
_MOST_JOBS = 200


class Frames(Message):
    """Ask for the frames of a segment from a number on."""

    operates = False
    kind: Literal["bus.frames"]
    segment: _Name
    since: Annotated[int, Field(ge=-1, le=2**53 - 1)] = -1
    words: Annotated[str, Field(max_length=200)] = ""
    cyclic: bool = True
    most: Annotated[int, Field(ge=1, le=MOST_ROWS)] = 200


class FrameDetails(Message):
    """Ask for the fields and bits of a frame."""

    operates = False
    kind: Literal["bus.frame"]
    segment: _Name
    number: Annotated[int, Field(ge=0, le=2**53 - 1)]


class Objects(Message):
    """Ask for the dictionary of a node, or the parameters of a drive on Modbus."""

    operates = False
    kind: Literal["bus.objects"]
    node: _Name


class ReadObject(Message):
    """Read an entry by SDO, or a parameter by data record 47; the value comes as a document `object`."""

    kind: Literal["bus.read"]
    node: _Name
    index: _Index
    sub: _Sub = 0


class ChangeObject(Message):
    """Write an entry by SDO, or a parameter by data record 47; the outcome comes as a document `object`."""

    kind: Literal["bus.write"]
    node: _Name
    index: _Index
    sub: _Sub = 0
    value: Annotated[str, Field(max_length=1000)]


class BusPane(Pane):
    """The buses of the bench.

    Args:
        session: Returns the session, which writes objects and records it.
        allow_motion: Whether objects of physical devices may be written.

    """

    name = "bus"

    def __init__(self, session: Callable[[], Session], *, allow_motion: bool) -> None:
        self._session = session
        self._allow_motion = allow_motion
        self._bench: Bench | None = None
        self._view: BusView | None = None
        self._jobs: list[tuple[SdoJob | ParameterTransfer, Client, str, int, int, bool]] = []

    @property
    def handlers(self) -> Mapping[type[Message], Handler]:
        """What it takes."""
        return {
            Frames: self._frames,
            FrameDetails: lambda message, _: self._the_view().details(message.segment, message.number),
            Objects: lambda message, _: self._the_view().objects(message.node),
            ReadObject: self._read,
            ChangeObject: self._write,
        }

    def begin(self, bench: Bench) -> None:
        """Take up a bench."""
        self._bench, self._view = bench, BusView(bench)

    def end(self) -> None:
        """Let go of the bench."""
        self._bench = self._view = None
        self._jobs = []

    def _the_view(self) -> BusView:
        if self._view is None:
            raise MessageError("no bench is up")
        return self._view

    def _frames(self, message: Frames, _: Client) -> object:
        return self._the_view().rows(
            message.segment,
            message.since,
            words=message.words,
            cyclic=message.cyclic,
            most=message.most,
        )

    def _read(self, message: ReadObject, client: Client) -> None:
        view = self._the_view()
        assert self._bench is not None  # there is a view of it
        if message.node in view.on_modbus:
            view.parameter(message.node, message.index, message.sub)
            transfer = ParameterTransfer()
            port = parameter_port(self._bench, message.node)
            port.read_parameter(message.index, message.sub, transfer.answer)
            self._note(transfer, client, message, wrote=False)
            return
        entry = view.entry(message.node, message.index, message.sub)
        if not entry.readable:
            raise MessageError(f"{message.index:04X}h:{message.sub} of {message.node} is write-only")
        job = self._bench.node(message.node).sdo.upload(message.index, message.sub)
        self._note(job, client, message, wrote=False)

    def _write(self, message: ChangeObject, client: Client) -> None:
        node, index, sub = message.node, message.index, message.sub
        view = self._the_view()
        step: WriteObject | WriteParameter
        if node in view.on_modbus:
            found = view.parameter(node, index, sub)
            step = WriteParameter(node, index, sub, found.type, parameter_value(found, message.value))
        else:
            step = WriteObject(node, index, sub, view.encoded(node, index, sub, message.value))
        assert self._bench is not None  # there is a view of it
        config = self._bench.config
        table = config.drive.get(node) or config.nodes[node]
        if table.device == "physical" and not self._allow_motion:
            raise MessageError(
                f"{node} is a physical device: it is written only by a cockpit started with --allow-motion"
            )
        self._note(self._session().do(step), client, message, wrote=True)

    def _note(
        self,
        job: SdoJob | ParameterTransfer,
        client: Client,
        message: ReadObject | ChangeObject,
        *,
        wrote: bool,
    ) -> None:
        if len(self._jobs) >= _MOST_JOBS:
            if isinstance(job, SdoJob):
                job.cancel()
            raise MessageError(f"{_MOST_JOBS} transfers wait already; let bench time pass")
        self._jobs.append((job, client, message.node, message.index, message.sub, wrote))

    def pulse(self, now_s: float) -> None:  # noqa: ARG002 - it looks every time
        """Send pages the transfers that have ended."""
        if not self._jobs:
            return
        waiting = []
        for one in self._jobs:
            job, client, node, index, sub, wrote = one
            if not job.done():
                waiting.append(one)
                continue
            client.send(
                {
                    "kind": "object",
                    "node": node,
                    "index": index,
                    "sub": sub,
                    "ok": job.ok,
                    "wrote": wrote,
                    "text": self._result(job, node, index, sub) if job.ok else job.reason,
                    "data": job.data.hex(" ").upper() if isinstance(job, SdoJob) and job.ok else "",
                }
            )
        self._jobs = waiting

    def _result(self, job: SdoJob | ParameterTransfer, node: str, index: int, sub: int) -> str:
        view = self._the_view()
        if isinstance(job, SdoJob):
            return view.value_text(node, index, sub, job.data)
        return parameter_text(view.parameter(node, index, sub), job.value or 0.0)

    def gone(self, client: Client) -> None:
        """Forget what a page has asked for."""
        self._jobs = [one for one in self._jobs if one[1] is not client]

    def description(self) -> object:
        """Return segments and nodes."""
        if self._bench is None or self._view is None:
            return None
        nodes = [{"name": name, "reason": "", "by": "SDO"} for name in self._view.nodes]
        nodes += [
            {"name": name, "reason": reason, "by": "data record 47"}
            for name, reason in self._view.on_modbus.items()
        ]
        return {"segments": list(self._bench.segment_names), "nodes": nodes}
