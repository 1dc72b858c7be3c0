"""Message definitions of ROS 2 Jazzy: schema text, type hash, and turning bytes into messages and back."""

from __future__ import annotations

from functools import cache
from typing import Any

from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from msrd_ros.core.errors import UserError

HEADER_TYPE = "std_msgs/msg/Header"


@cache
def typestore() -> Typestore:
    """All message types of the distribution's common interfaces."""
    return get_typestore(Stores.ROS2_JAZZY)


def is_known_type(type_name: str) -> bool:
    """Whether a message type is one of the distribution's."""
    return type_name in typestore().fielddefs


@cache
def describe_type(type_name: str) -> tuple[bytes, str]:
    """Schema of a message type, as a bag carries it.

    Returns
    -------
    The definition with all that it is made of (``ros2msg``), and its hash (``RIHS01_...``).

    Raises
    ------
    UserError
        If the type is none of the distribution's.
    """
    if not is_known_type(type_name):
        raise UserError(f"message type {type_name} is unknown; only common_interfaces can be recorded")
    definition, _ = typestore().generate_msgdef(type_name, ros_version=2)
    return definition.encode(), typestore().hash_rihs01(type_name)


def deserialise(data: bytes, type_name: str) -> Any:
    """Message with the field names of the ROS type; arrays are NumPy arrays.

    Raises
    ------
    UserError
        If the bytes are no such message.
    """
    try:
        return typestore().deserialize_cdr(data, type_name)
    except Exception as error:  # bytes from elsewhere make the reader stumble in many ways
        reason = (str(error).splitlines() or [""])[0]
        raise UserError(
            f"{len(data)} bytes are no {type_name} ({type(error).__name__}: {reason}); record them again"
        ) from None


def serialise(message: Any, type_name: str) -> bytes:
    """CDR of a message from `deserialise`."""
    return bytes(typestore().serialize_cdr(message, type_name))


def with_frame(data: bytes, type_name: str, frame_id: str) -> bytes:
    """The same message with another `header.frame_id`; a bare std_msgs/Header is its own header.

    Raises
    ------
    UserError
        If the bytes are no such message.
    """
    message = deserialise(data, type_name)
    header = message if type_name == HEADER_TYPE else message.header
    header.frame_id = frame_id
    return serialise(message, type_name)
