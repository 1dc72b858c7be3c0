"""Nodes with a life cycle, as `ros2 lifecycle` knows it; by default they start by themselves."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from types import MappingProxyType
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn

from msrd_ros.core.errors import UserError
from msrd_ros.core.parameters import parameter
from msrd_ros.nodes.common import StackNode

LIFECYCLE_SERVICES: Mapping[str, str] = MappingProxyType(
    {
        "~/change_state": "ChangeState",
        "~/get_state": "GetState",
        "~/get_available_states": "GetAvailableStates",
        "~/get_available_transitions": "GetAvailableTransitions",
        "~/get_transition_graph": "GetAvailableTransitions",
    }
)
"""What rclpy offers for every managed node; their types are those of lifecycle_msgs."""

_NEXT = {"unconfigured": "configure", "inactive": "activate"}
"""What is to be asked of a node that waits in a state."""


def autostart_parameter() -> Any:
    """The parameter `autostart` of every managed node."""
    return parameter(True, "Configure and activate at the start; false waits to be told (ros2 lifecycle)")


class ManagedNode(LifecycleNodeMixin, StackNode):
    """A node that is configured, activated, deactivated and cleaned up.

    Topics, services and timers that are made from `configure` on are destroyed by a clean-up; what else has
    to be given back then, or at the end of the process, is put on `_held`. An error in a transition leaves
    the node where it was and is logged; at a start by itself it ends the node, as that of any other does.

    Attributes
    ----------
    active
        Whether it works; so already while it is being activated, and until it has been deactivated.
    """

    def __init__(self, name: str, config_type: type[Any], **options: Any) -> None:
        StackNode.__init__(self, name, config_type, **options)
        LifecycleNodeMixin.__init__(self)
        self._ask_state_machine = self._service_change_state.callback
        self._service_change_state.callback = self._on_change_state
        self._lasting = [part for part, _ in self._parts()]
        self._held = ExitStack()
        self._failure: Exception | None = None
        self.active = False
        if self.config.autostart:
            for trigger in (self.trigger_configure, self.trigger_activate):
                trigger()  # type: ignore[no-untyped-call]
                if self._failure is not None:
                    raise self._failure

    # -- what nodes override -------------------------------------------------------------------

    def configure(self) -> None:
        """Set up everything; no work is done yet."""

    def activate(self) -> None:
        """Begin to work, or go on."""

    def deactivate(self) -> None:
        """Stop working, in a way that harms nobody."""

    # -- states --------------------------------------------------------------------------------

    @property
    def state(self) -> str:
        """The present state's name: unconfigured, inactive, active or finalized."""
        return str(self._state_machine.current_state[1])

    def require_active(self) -> None:
        """Refuse what only a node at work does.

        Raises
        ------
        UserError
            If it is not active; says how to make it so.
        """
        if not self.active:
            raise UserError(f"{self.get_name()} is {self.state}; {self._way_on()}")

    def refuses(self, response: Any) -> bool:
        """Whether a Trigger is refused because the node is not active; its response then says so."""
        try:
            self.require_active()
        except UserError as error:
            response.success, response.message = False, str(error)
        return not self.active

    def close(self) -> None:
        """Give back what is held, from whatever state."""
        self._held.close()

    def account(self) -> tuple[str, Mapping[str, object], list[str]]:
        """How it is doing; of a node that is not active, its state and how to go on."""
        if self.active:
            return super().account()
        message, values = self.diagnose() if self.state == "inactive" else ("", {})
        waits = [f"leave to {_NEXT.get(self.state, 'begin anew')}: {self._way_on()}"]
        if self._failure is not None:
            # Waits are told apart by semicolons.
            waits.insert(0, f"what was refused: {str(self._failure).replace('; ', ', ')}")
        return f"{self.state}, {message}" if message else self.state, values, waits

    def _way_on(self) -> str:
        name, step = self.get_fully_qualified_name(), _NEXT.get(self.state)
        if step is None:
            return "end it and start it again"
        return f"call {name}/change_state (ros2 lifecycle set {name} {step})"

    # -- transitions, called by rclpy ------------------------------------------------------------

    def on_configure(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Take everything that is needed, or nothing."""
        done = self._try(self.configure)
        if done is TransitionCallbackReturn.FAILURE:
            self._give_back()
        return done

    def on_activate(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Begin to work."""
        self.active = True
        done = self._try(self.activate)
        self.active = done is TransitionCallbackReturn.SUCCESS
        return done

    def on_deactivate(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Stop working."""
        done = self._try(self.deactivate)
        self.active = False
        # Not active, whatever was wrong: a mere failure would leave it so.
        return done if done is TransitionCallbackReturn.SUCCESS else TransitionCallbackReturn.ERROR

    def on_cleanup(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Give everything back."""
        done = self._try(self._give_back)
        return done if done is TransitionCallbackReturn.SUCCESS else TransitionCallbackReturn.ERROR

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Give everything back for good."""
        if self.active:
            done = self.on_deactivate(state)
            if done is not TransitionCallbackReturn.SUCCESS:
                return done
        return self.on_cleanup(state)

    def on_error(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Give back what can be."""
        self.active = False
        try:
            self._give_back()
        except Exception:  # what was held has been let go of all the same
            self.get_logger().error(traceback.format_exc())
        return TransitionCallbackReturn.SUCCESS

    def _try(self, step: Callable[[], None]) -> TransitionCallbackReturn:
        """Take a step; rclpy would drop the error without a word."""
        self._failure = None
        try:
            step()
        except UserError as error:
            self._failure = error
            return TransitionCallbackReturn.FAILURE
        except Exception as error:
            self._failure = error
            return TransitionCallbackReturn.ERROR
        return TransitionCallbackReturn.SUCCESS

    def _on_change_state(self, request: Any, response: Any) -> Any:
        """Answer ~/change_state; a transition that does not lead on from here must not end the node."""
        labels = {transition[0]: transition[1] for transition in self._state_machine.transition_graph}
        number = request.transition.id
        wanted = request.transition.label or labels.get(number, f"transition {number}")
        before, (earlier, self._failure) = self.state, (self._failure, None)
        try:
            response = self._ask_state_machine(request, response)
        except rclpy_implementation.RCLError:
            response.success = False
        error = self._failure
        if response.success:
            self.get_logger().info(f"is {self.state} now")
        elif error is None:
            self._failure = earlier
            self.get_logger().error(f"{wanted} does not lead on from {before}")
        elif isinstance(error, UserError):
            self.get_logger().error(f"{wanted} was refused, it is {self.state}: {error}")
        else:
            trace = "".join(traceback.format_exception(error))
            self.get_logger().error(f"{wanted} went wrong, it is {self.state}: {trace}")
        # At once: who waits for it need not wait for the next second.
        self.publish_diagnostics()
        return response

    # -- what is held --------------------------------------------------------------------------

    def _give_back(self) -> None:
        """Undo `configure`."""
        try:
            self._held.close()
        finally:
            self._hooks.clear()
            # Of use_sim_time, which may be set at any time.
            kept = [*self._lasting, self._time_source._clock_sub]
            for part, destroy in list(self._parts()):
                if part not in kept:
                    destroy(part)

    def _parts(self) -> Iterator[tuple[Any, Callable[[Any], bool]]]:
        """Everything that the node has of rclpy, and what destroys it."""
        for parts, destroy in (
            (self.timers, self.destroy_timer),
            (self.subscriptions, self.destroy_subscription),
            (self.services, self.destroy_service),
            (self.clients, self.destroy_client),
            (self.guards, self.destroy_guard_condition),
            (self.publishers, self.destroy_publisher),
        ):
            yield from ((part, destroy) for part in parts)
