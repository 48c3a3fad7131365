"""A slow and plain model of a CAN bus: every node reads every bit, and nothing is computed ahead.

What campaigns and tests compare the virtual segment with. It shares no code with it: frames are lists of bits
that are made here, and a node is a generator that yields the bit it sends and is given the bit that it reads
(0 dominant, 1 recessive). Time is counted in bits.
"""

ACTIVE, PASSIVE, BUS_OFF = "ERROR_ACTIVE", "ERROR_PASSIVE", "BUS_OFF"


def checksum(bits):
    """Return the 15 bits of the CRC of `bits` by long division (CANP-012)."""
    generator = [1, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1]
    rest = list(bits) + [0] * 15
    for start in range(len(bits)):
        if rest[start]:
            for offset, term in enumerate(generator):
                rest[start + offset] ^= term
    return rest[-15:]


def number(value, width):
    """Return `value` as bits, the most significant first."""
    return [int(digit) for digit in format(value, f"0{width}b")]


def plain_bits(frame):
    """Return the bits of a frame from SOF to CRC without stuff bits, and how many belong to the arbitration
    field.
    """
    if frame.extended:
        head = [
            0,
            *number(frame.can_id >> 18, 11),
            1,
            1,
            *number(frame.can_id & 0x3FFFF, 18),
            int(frame.remote),
        ]
        bits = [*head, 0, 0]
    else:
        head = [0, *number(frame.can_id, 11), int(frame.remote)]
        bits = [*head, 0, 0]
    bits += number(frame.dlc, 4)
    for byte in frame.data:
        bits += number(byte, 8)
    return bits + checksum(bits), len(head)


def stuffed(bits):
    """Return pairs (bit, number of plain bits before it, is it a stuff bit)."""
    wire = []
    for index, bit in enumerate(bits):
        wire.append((bit, index, False))
        if len(wire) >= 5 and len({one for one, _, _ in wire[-5:]}) == 1:
            wire.append((1 - bit, index + 1, True))
    return wire


def expected_length(plain):
    """Return how many plain bits the frame that begins with `plain` has, SOF to CRC; None: not known yet."""
    header = 39 if len(plain) > 13 and plain[13] else 19
    if len(plain) < header:
        return None
    remote = plain[32 if header == 39 else 12]
    dlc = int("".join(map(str, plain[header - 4 : header])), 2)
    return header + (0 if remote else 8 * min(dlc, 8)) + 15


class WrongBitError(Exception):
    """An error that the node has found in the bit just read."""

    def __init__(self, kind, *, excused=False, in_flag=False):
        super().__init__(kind)
        self.kind = kind
        self.excused = excused
        self.in_flag = in_flag


class OverloadError(Exception):
    """A dominant bit that asks for an overload flag."""


class Node:
    """A node; `queue` has pairs of the bit time of the request and the frame."""

    def __init__(self, name, frames=(), *, tec=0, rec=0, acknowledges=True, overloads=0, one_shot=False):
        self.name = name
        self.tec = tec
        self.rec = rec
        self.state = PASSIVE if max(tec, rec) >= 128 else ACTIVE
        self.states = []
        self.frames = sorted(frames, key=lambda pair: pair[0])
        self.queue = list(self.frames)
        self.received = []
        self.sent = []
        self.errors = []
        self.acknowledges = acknowledges
        self.overloads = overloads
        self.one_shot = one_shot
        self.now = 0
        self.resting = True
        self._sending = None
        self._was_sender = False
        self._overloads_left = 0
        self._life = self._live()
        self.sends = next(self._life)

    def read(self, bit, now):
        """Take the level of the bit that ends at `now`."""
        self.now = now
        self.sends = self._life.send(bit)

    @property
    def pending(self):
        """The frame that the node would start now."""
        ready = [pair for pair in self.queue if pair[0] <= self.now]
        return min(ready, key=lambda pair: (_rank(pair[1]), pair[0], self.queue.index(pair)), default=None)

    # ------------------------------------------------------------------------------------------- life

    def _live(self):
        sof = False
        while self.state != BUS_OFF:
            try:
                if not sof:
                    yield from self._idle()
                yield from self._frame(joining=sof == "join")
                sof = yield from self._between()
            except WrongBitError as wrong:
                sof = yield from self._error_or_overload(wrong)
            except OverloadError:
                sof = yield from self._error_or_overload(None)
        self.queue = []
        self.resting = True
        while True:
            yield 1

    def _idle(self):
        """Wait for a SOF of somebody else, or for an own frame."""
        self._was_sender = False
        self.resting = True
        while self.pending is None:
            if (yield 1) == 0:
                self.resting = False
                return
        self.resting = False
        self._sending = self.pending
        self.queue.remove(self._sending)

    def _error_or_overload(self, wrong):
        """Flags and delimiters until everything is in order again; returns as `_between` does."""
        while self.state != BUS_OFF:
            try:
                if wrong is not None:
                    yield from self._error_flag(wrong)
                else:
                    yield from self._overload_flag()
                if self.state == BUS_OFF:
                    break
                yield from self._delimiter()
                return (yield from self._between())
            except WrongBitError as another:
                wrong = another
            except OverloadError:
                wrong = None
        return False

    def _between(self):
        """Intermission and suspension; returns False for idle, True for a SOF, "join" for one that the node
        joins.
        """
        if self._overloads_left:
            self._overloads_left -= 1
            raise OverloadError
        passive_sender = self._was_sender and self.state == PASSIVE
        for position in (1, 2, 3):
            if (yield 1) == 0:
                if position < 3:
                    raise OverloadError
                if passive_sender or self.pending is None:
                    return True
                self._sending = self.pending
                self.queue.remove(self._sending)
                return "join"
        if passive_sender:
            for _ in range(8):
                if (yield 1) == 0:
                    return True
        return False

    # ------------------------------------------------------------------------------------------- frame

    def _frame(self, *, joining):
        """One frame: as sender if there is one to send, otherwise as receiver with the SOF read already."""
        wire, plain = [], []
        self._overloads_left = 0
        sending = self._sending
        self._was_sender = sending is not None
        mine, arbitration = [], 0
        if sending is not None:
            bits, arbitration = plain_bits(sending[1])
            mine = stuffed(bits)
        run = 0
        while expected_length(plain) is None or len(plain) < expected_length(plain) or run == 5:
            place = len(wire)
            own, before, is_stuff = mine[place] if self._sending else (1, 0, False)
            bit = 0 if place == 0 and (joining or not sending) else (yield own)
            if self._sending and bit != own:
                if own and 0 < before < arbitration and is_stuff:
                    raise WrongBitError("STUFF", excused=True)
                if own and before < arbitration and not is_stuff:
                    self._lose()
                else:
                    raise WrongBitError("BIT")
            if run == 5:
                if bit == wire[-1]:
                    raise WrongBitError("STUFF")
                run = 1
            else:
                run = run + 1 if wire and bit == wire[-1] else 1
                plain.append(bit)
            wire.append(bit)
        good = checksum(plain[:-15]) == plain[-15:]
        if (yield 1) == 0:
            raise WrongBitError("FORM")
        answer = 0 if good and not self._sending and self.acknowledges else 1
        if (yield answer) and self._sending:
            raise WrongBitError("ACK")
        if (yield 1) == 0:
            raise WrongBitError("FORM")
        if not good and not self._sending:
            raise WrongBitError("CRC")
        for position in range(1, 8):
            bit = yield 1
            if bit == 0 and (self._sending or position < 7):
                raise WrongBitError("FORM")
        if self._sending:
            self.sent.append((self.now, self._sending[1]))
            self._sending = None
            self.tec = max(self.tec - 1, 0)
        else:
            self.received.append((self.now, _content(plain)))
            self.rec = 119 if self.rec > 127 else max(self.rec - 1, 0)
            self._overloads_left = self.overloads
        self._judge()
        if bit == 0:
            raise OverloadError

    def _lose(self):
        if not self.one_shot:
            self.queue.append(self._sending)
        self._sending = None
        self._was_sender = False

    # ------------------------------------------------------------------------------------------- errors

    def _judge(self):
        """Work out the state that belongs to the counters."""
        state = BUS_OFF if self.tec >= 256 else PASSIVE if max(self.tec, self.rec) >= 128 else ACTIVE
        if state != self.state:
            self.states.append(state)
            self.state = state

    def _add(self, amount):
        if self._was_sender:
            self.tec += amount
        else:
            self.rec = min(self.rec + amount, 255)
        self._judge()

    def _error_flag(self, wrong):
        active = self.state == ACTIVE
        self.errors.append((self.now, wrong.kind))
        if self._sending is not None:
            if not self.one_shot:
                self.queue.append(self._sending)
            self._sending = None
        forgiven = self._was_sender and wrong.kind == "ACK" and not active
        if self._was_sender:
            if not wrong.excused and not forgiven:
                self._add(8)
        else:
            self._add(8 if wrong.in_flag else 1)
        if self.state == BUS_OFF:
            return
        if active:
            for _ in range(6):
                if (yield 0) == 1:
                    raise WrongBitError("BIT", in_flag=True)
        else:
            seen = []
            while len(seen) < 6 or len(set(seen[-6:])) > 1:
                bit = yield 1
                seen.append(bit)
                if bit == 0 and forgiven:
                    forgiven = False
                    self._add(8)
                    if self.state == BUS_OFF:
                        return
        yield from self._until_recessive(error=True)

    def _overload_flag(self):
        for _ in range(6):
            if (yield 0) == 1:
                raise WrongBitError("BIT", in_flag=True)
        yield from self._until_recessive(error=False)

    def _until_recessive(self, *, error):
        dominant = 0
        while (yield 1) == 0:
            dominant += 1
            if dominant == 1 and error and not self._was_sender:
                self._add(8)
            if dominant % 8 == 0:
                self._add(8)
            if self.state == BUS_OFF:
                return

    def _delimiter(self):
        """Bits 2 to 8 of the delimiter; the first ended the flag."""
        for position in range(2, 9):
            if (yield 1) == 0:
                raise OverloadError if position == 8 else WrongBitError("FORM")


def _rank(frame):
    bits, arbitration = plain_bits(frame)
    return bits[: arbitration + (not frame.extended)]


def _content(plain):
    """Return identifier, extended, remote, DLC and data of the plain bits of a frame."""

    def value(bits):
        return int("".join(map(str, bits)), 2)

    extended = bool(plain[13])
    can_id = value(plain[1:12] + plain[14:32]) if extended else value(plain[1:12])
    remote = bool(plain[32 if extended else 12])
    header = 39 if extended else 19
    body = plain[header:-15]
    data = bytes(value(body[start : start + 8]) for start in range(0, len(body), 8))
    return can_id, extended, remote, value(plain[header - 4 : header]), data


def run(nodes, flips, *, at_most=20_000):
    """Run until nobody has anything to do; returns the levels of the bus, or None when it goes on for ever.

    `flips` maps a bit time to the names of the nodes that read that bit inverted, None for all.
    """
    levels = []
    last = max([0, *flips, *(time for node in nodes for time, _ in node.frames)])
    quiet = 0
    while len(levels) <= last or quiet < 12:
        now = len(levels)
        if now > at_most:
            return None
        level = min(node.sends for node in nodes)
        for node in nodes:
            read = level
            if now in flips and (flips[now] is None or node.name in flips[now]):
                read ^= 1
            node.read(read, now + 1)
        levels.append(level)
        done = all(node.resting and not node.queue for node in nodes)
        quiet = quiet + 1 if done else 0
    return levels
