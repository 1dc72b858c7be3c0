"""The one exception that is meant for the user's eyes."""

from __future__ import annotations


class UserError(Exception):
    """Bad input that the user can mend.

    The message is one line: it names the file, topic, parameter or joint, and says what to do.
    Executables print it without a traceback and exit with status 2.
    """
