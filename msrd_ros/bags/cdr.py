"""The header of a serialised message, read without deserialising the rest.

Source: OMG DDS-XTypes, plain CDR version 1: four bytes of encapsulation, then the fields in order, each
aligned to its size. A std_msgs/Header that comes first lies at fixed offsets.
"""

from __future__ import annotations

import struct

_LITTLE = struct.Struct("<iII")
_BIG = struct.Struct(">iII")
_HEADER_OFFSET = 4
_TEXT_OFFSET = _HEADER_OFFSET + _LITTLE.size
_NANOSECONDS = 1_000_000_000


def read_header(data: bytes) -> tuple[int, str]:
    """Stamp in nanoseconds and frame_id of a message whose first field is a std_msgs/Header.

    Raises
    ------
    ValueError
        If `data` is too short or no CDR.
    """
    if len(data) < _TEXT_OFFSET or data[0] != 0 or data[1] > 1:
        raise ValueError(f"{len(data)} bytes are no CDR message with a header")
    sec, nanosec, length = (_LITTLE if data[1] else _BIG).unpack_from(data, _HEADER_OFFSET)
    # The length counts the NUL that ends the text.
    text = data[_TEXT_OFFSET : _TEXT_OFFSET + max(length - 1, 0)]
    if len(text) != max(length - 1, 0):
        raise ValueError(f"frame_id of {length} bytes in a message of {len(data)}")
    return sec * _NANOSECONDS + nanosec, text.decode("utf-8", errors="replace")


def read_joint_names(data: bytes) -> tuple[str, ...]:
    """Names of a serialised sensor_msgs/JointState, which has them right behind its header.

    Raises
    ------
    ValueError
        If `data` is too short or no CDR.
    """
    order = "<" if read_header(data) and data[1] else ">"
    try:
        (length,) = struct.unpack_from(f"{order}I", data, _TEXT_OFFSET - 4)
        offset = _TEXT_OFFSET + length
        offset += -(offset - _HEADER_OFFSET) % 4
        (count,) = struct.unpack_from(f"{order}I", data, offset)
        offset += 4
        names = []
        for _ in range(count):
            offset += -(offset - _HEADER_OFFSET) % 4
            (length,) = struct.unpack_from(f"{order}I", data, offset)
            offset += 4 + length
            if offset > len(data):
                raise ValueError(f"a name of {length} bytes in a message of {len(data)}")
            names.append(data[offset - length : offset - 1].decode("utf-8", errors="replace"))
    except struct.error:
        raise ValueError(f"{len(data)} bytes end within the names of joints") from None
    return tuple(names)


def read_stamp_ns(data: bytes) -> int:
    """Stamp in nanoseconds of a message whose first field is a std_msgs/Header."""
    return read_header(data)[0]


def read_frame_id(data: bytes) -> str:
    """The frame_id of a message whose first field is a std_msgs/Header."""
    return read_header(data)[1]
