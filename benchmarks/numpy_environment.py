"""One helper's flight in NumPy: the environment that the other libraries step.

It is written for speed, so that no library is held up by it: what a slot need not repeat is
computed once, buffers are reused, and the few scalars are Python's own. The tests hold it equal
to the model. It imports neither PyTorch nor TorchRL.
"""

import math
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from hyuav.physics.scenario import Scenario

Floats = NDArray[np.float64]


class NumpyEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """The helper's flight as :func:`hyuav.make_env` shows it to a learner, for one helper.

    Observation: Box (U + 5,) float32, the position, the mode (-1 jamming, 1 relay) and the
    distances, normalized. Action: Box (2,) float32 in [-1, 1], the velocity in units of v_max.
    Reward in bps/Hz, with the off-map penalty. Truncated after T slots, never terminated.

    Args:
        scenario: node positions and parameters.
        scheme: "hybrid", "relay" or "jamming".
        seed: of fading and tasks.
    """

    def __init__(self, scenario: Scenario, scheme: str = "hybrid", seed: int | None = None) -> None:
        self.scenario, self.scheme = scenario, scheme
        size = scenario.num_ues + 5
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
        self._rng = np.random.default_rng(seed)
        self._half = scenario.map_side / 2
        self._reach = scenario.max_speed * scenario.slot_duration
        self._norm_limit = self._longest_flight()
        self._prepare_channels()
        self._prepare_modes()
        self.start = scenario.helper_starts[0]
        self.slots = 0
        self.x, self.y = self.start
        self.relay = False

    def _longest_flight(self) -> float | None:
        """The bound of a slot's flight in m; None where that of each component suffices."""
        s = self.scenario
        relaying = s.relay_power * s.slot_duration / 2
        jamming = s.jamming_power * s.slot_duration
        sending = {"relay": relaying, "jamming": jamming, "hybrid": max(relaying, jamming)}
        left = max(s.helper_energy_budget - sending[self.scheme], 0.0)
        speed = math.sqrt(left / (0.5 * s.helper_mass * s.slot_duration))
        disc = s.speed_limit == "disc"
        reachable = s.max_speed * (1.0 if disc else math.sqrt(2.0))
        if not disc and speed >= reachable:
            return None
        return min(speed, reachable) * s.slot_duration

    def _prepare_channels(self) -> None:
        """Signal-to-noise ratios: U from the UEs to L, U to H, U to E, H to L, H to E.

        Those that do not depend on the helper's position are filled in once.
        """
        s, count = self.scenario, self.scenario.num_ues
        nodes = [*s.ue_positions, s.legitimate_position, s.eavesdropper_positions[0]]
        self._node_x, self._node_y = np.array(nodes).T.copy()
        climb = s.altitude - s.eavesdropper_altitude
        self._heights = np.array([s.altitude**2] * count + [0.0, climb**2])
        ue_snr = s.ue_power / s.noise_power * s.ground_to_air_gain
        self._scale = np.array([ue_snr] * count + [s.air_to_air_gain / s.noise_power] * 2)
        self._means = np.empty(3 * count + 2)
        ues = np.array(s.ue_positions)
        self._ue_to_legitimate = np.hypot(*(ues - s.legitimate_position).T)
        to_eavesdropper = np.hypot(*(ues - s.eavesdropper_positions[0]).T)
        ground = np.maximum(self._ue_to_legitimate**2 + s.altitude**2, 1.0)
        above = np.maximum(to_eavesdropper**2 + s.eavesdropper_altitude**2, 1.0)
        self._means[:count], self._means[2 * count : 3 * count] = ue_snr / ground, ue_snr / above
        self._mean_to_helper = self._means[count : 2 * count]
        self._mean_in_the_air = self._means[3 * count :]
        self._snr = np.empty_like(self._means)
        self._to_legitimate, self._to_helper, self._to_eavesdropper, self._in_the_air = np.split(
            self._snr, [count, 2 * count, 3 * count]
        )
        factors = 10.0 ** (
            np.array([s.ground_to_air_k_factor] * 3 * count + [s.air_to_air_k_factor] * 2) / 10
        )
        self._line_of_sight = np.sqrt(factors / (factors + 1.0))
        self._scatter = np.sqrt(0.5 / (factors + 1.0))
        self._normals = np.empty((2, 3 * count + 2))
        self._real, self._imaginary = self._normals

    def _prepare_modes(self) -> None:
        """Buffers with a row for relaying and one for jamming, and who may offload at all."""
        s, count = self.scenario, self.scenario.num_ues
        self._legitimate, self._eavesdropper = np.empty((2, 2, count))
        self._legitimate_rows, self._eavesdropper_rows = [*self._legitimate], [*self._eavesdropper]
        self._bits = np.array([[0.5], [1.0]]) / math.log(2.0)  # relaying takes two halves
        sending = s.ue_power * s.slot_duration / count
        covered = self._ue_to_legitimate <= s.coverage_radius
        self._can_relay = covered & (sending / 2 <= s.ue_energy_budget)
        self._allowed = np.empty((2, count), bool)
        self._allowed_to_relay = self._allowed[0]
        self._allowed[1] = covered & (sending <= s.ue_energy_budget)
        cycles = count * s.task_size[1] * s.cycles_per_bit[1]
        self._edge_can_saturate = self._edge_energy(cycles) > s.edge_energy_budget

    def _edge_energy(self, cycles: Any) -> Any:
        s = self.scenario
        return (s.capacitance ** (1 / 3) * cycles / s.slot_duration) ** 3 * s.slot_duration

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode at ``start``; there are no ``options``."""
        super().reset(options=options)
        if seed is not None:
            self._rng = np.random.default_rng(seed)
        self.x, self.y = self.start
        self.slots = 0
        _, observation = self._slot()
        return observation, {}

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Fly one slot: observation (U + 5,), reward in bps/Hz, terminated, truncated, nothing."""
        vx, vy = action.tolist()
        dx = min(max(vx, -1.0), 1.0) * self._reach
        dy = min(max(vy, -1.0), 1.0) * self._reach
        if self._norm_limit is not None and (norm := math.hypot(dx, dy)) > self._norm_limit:
            dx *= self._norm_limit / norm
            dy *= self._norm_limit / norm
        x, y, half, penalty = self.x + dx, self.y + dy, self._half, 0.0
        if -half <= x <= half and -half <= y <= half:
            self.x, self.y = x, y
        else:
            penalty = self.scenario.off_map_penalty
        sum_rate, observation = self._slot()
        self.slots += 1
        return observation, sum_rate - penalty, False, self.slots >= self.scenario.num_slots, {}

    def draw_fading(self) -> Floats | None:
        """One slot's fading powers (3 U + 2,), or None where fading is off."""
        if not self.scenario.fading:
            return None
        normals = self._rng.standard_normal(out=self._normals)
        normals *= self._scatter
        self._real += self._line_of_sight
        normals *= normals
        self._real += self._imaginary
        return self._real

    def draw_cycles(self) -> Floats:
        """One slot's CPU cycles S_u F_u of the UEs' tasks (U,)."""
        s, uniform = self.scenario, self._rng.random((2, self.scenario.num_ues))
        size = s.task_size[0] + (s.task_size[1] - s.task_size[0]) * uniform[0]
        per_bit = s.cycles_per_bit[0] + (s.cycles_per_bit[1] - s.cycles_per_bit[0]) * uniform[1]
        cycles: Floats = size * per_bit
        return cycles

    def _slot(self) -> tuple[float, NDArray[np.float32]]:
        """The secrecy sum-rate in bps/Hz at the helper's position, and the observation."""
        squared = self._node_x - self.x
        squared *= squared
        across = self._node_y - self.y
        across *= across
        squared += across
        distances = np.sqrt(squared)
        squared += self._heights
        np.maximum(squared, 1.0, out=squared)
        np.divide(self._scale, squared, out=squared)
        self._mean_to_helper[:], self._mean_in_the_air[:] = squared[:-2], squared[-2:]
        fading = self.draw_fading()
        np.multiply(self._means, 1.0 if fading is None else fading, out=self._snr)
        relay_rate, jamming_rate = self._sum_rates(distances)
        if self.scheme == "hybrid":
            self.relay = relay_rate > jamming_rate
        else:
            self.relay = self.scheme == "relay"
        distances /= self._half
        distances -= 1.0
        observation = np.empty(distances.size + 3, np.float32)
        mode = 1.0 if self.relay else -1.0
        observation[:3] = self.x / self._half, self.y / self._half, mode
        observation[3:] = distances
        return (relay_rate if self.relay else jamming_rate), observation

    def _sum_rates(self, distances: Floats) -> tuple[float, float]:
        """C_1 and C_0 in bps/Hz; both modes go through the same few operations as two rows."""
        s = self.scenario
        air_to_legitimate, air_to_eavesdropper = self._in_the_air.tolist()
        relayed, unjammed = self._legitimate_rows
        np.add(self._to_legitimate, s.relay_power * air_to_legitimate, out=relayed)
        np.minimum(relayed, self._to_helper, out=relayed)
        share = 1.0 / (s.jamming_power * air_to_legitimate + 1.0)
        np.multiply(self._to_legitimate, share, out=unjammed)
        overheard, jammed = self._eavesdropper_rows
        np.add(self._to_eavesdropper, s.relay_power * air_to_eavesdropper, out=overheard)
        share = 1.0 / (s.jamming_power * air_to_eavesdropper + 1.0)
        np.multiply(self._to_eavesdropper, share, out=jammed)
        rates = np.log1p(self._legitimate, out=self._legitimate)
        rates -= np.log1p(self._eavesdropper, out=self._eavesdropper)
        rates *= self._bits
        near_helper = distances[:-2] <= s.coverage_radius
        np.logical_and(self._can_relay, near_helper, out=self._allowed_to_relay)
        offloading = rates > s.min_secrecy_rate
        offloading &= self._allowed
        if self._edge_can_saturate:
            cycles = self.draw_cycles()
            relay, jamming = map(self._admitted, rates, offloading, (cycles, cycles))
        else:
            rates *= offloading
            relay, jamming = np.add.reduce(rates, axis=1).tolist()
        return relay, jamming

    def _admitted(self, rates: Floats, offloading: NDArray[np.bool_], cycles: Floats) -> float:
        """The sum-rate of the UEs that the edge server takes, best first, within E_L."""
        order = np.flatnonzero(offloading)
        order = order[np.argsort(-rates[order], kind="stable")]
        energy = self._edge_energy(np.cumsum(cycles[order]))
        taken = order[energy <= self.scenario.edge_energy_budget]
        return float(rates[taken].sum())
