"""Algorithm 1 of the paper in plain Python, read from its text: the oracle of the preset `paper`.

Dense 6 x 6 matrices over [x, y, vx, vy, ax, ay], SciPy's assignment, one object a track. It shares no code
with the tracker; what the paper leaves open (base noise, jerk, prior, gate) comes in as numbers.
"""

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.stats import chi2

H = np.hstack([np.eye(2), np.zeros((2, 4))])


class PaperTrack:
    """One track: state, covariance, noise scale per sensor, lifecycle."""

    def __init__(self, z, R, t, velocity_std, acceleration_std):
        self.x = np.array([*z, 0.0, 0.0, 0.0, 0.0])
        self.P = np.diag([R, R, velocity_std**2, velocity_std**2, acceleration_std**2, acceleration_std**2])
        self.scale = {"rgb": 1.0, "evt": 1.0}
        self.t_birth = self.t_update = t
        self.hits, self.confirmed = 1, False

    def predict(self, dt, jerk):  # eq. 2
        F = np.kron([[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]], np.eye(2))
        Q = [
            [dt**5 / 20, dt**4 / 8, dt**3 / 6],
            [dt**4 / 8, dt**3 / 3, dt**2 / 2],
            [dt**3 / 6, dt**2 / 2, dt],
        ]
        self.x, self.P = F @ self.x, F @ self.P @ F.T + np.kron(jerk**2 * np.array(Q), np.eye(2))

    def innovation(self, z, R):
        y, S = z - H @ self.x, H @ self.P @ H.T + R * np.eye(2)
        return y, S, float(y @ np.linalg.solve(S, y))

    def update(self, z, R, sensor, t):  # eq. 4 and 5
        y, S, nis = self.innovation(z, R)
        K = self.P @ H.T @ np.linalg.inv(S)
        left = np.eye(6) - K @ H
        self.x, self.P = self.x + K @ y, left @ self.P @ left.T + R * K @ K.T
        self.scale[sensor] = max(0.5, min(self.scale[sensor] * (1 + 0.1 * (nis / 2 - 1)), 5.0))
        self.hits, self.t_update = self.hits + 1, t


class PaperTracker:
    """Algorithm 1 over batches of detections (z, score, sensor) at one time."""

    def __init__(self, sigma, jerk, velocity_std, acceleration_std, gate_probability):
        self.sigma, self.jerk, self.prior = sigma, jerk, (velocity_std, acceleration_std)
        self.gate = chi2.ppf(gate_probability, 2)
        self.tracks, self.t = [], None

    def noise(self, track, detection):
        _, score, sensor = detection
        return track.scale[sensor] * self.sigma[sensor] ** 2 / max(score, 0.1)

    def distance(self, track, detection):
        return track.innovation(detection[0], self.noise(track, detection))[2]

    def step(self, t, detections):
        if self.t is not None and t > self.t:
            for track in self.tracks:
                track.predict(t - self.t, self.jerk)
        self.t, left = t, list(range(len(detections)))
        matched = []
        if self.tracks and detections:
            cost = np.array([[self.distance(track, d) for d in detections] for track in self.tracks])
            cost[cost > self.gate] = 1e7  # "+inf", which the solver cannot take
            matched = [(i, j) for i, j in zip(*linear_sum_assignment(cost), strict=True) if cost[i, j] < 1e7]
        for i, j in matched:
            z, _, sensor = detections[j]
            self.tracks[i].update(z, self.noise(self.tracks[i], detections[j]), sensor, t)
            left.remove(j)
        for i, j in matched:  # second pass, on the track as it is now
            track, first = self.tracks[i], detections[j][2]
            inside = [(self.distance(track, detections[k]), k) for k in left if detections[k][2] != first]
            inside = [pair for pair in inside if pair[0] <= self.gate]
            if inside:
                _, k = min(inside)
                track.update(detections[k][0], self.noise(track, detections[k]), detections[k][2], t)
                left.remove(k)
        for track in self.tracks:
            track.confirmed |= t - track.t_birth >= 0.5 and track.hits >= 5
        alive = [r for r in self.tracks if not t - r.t_update > (0.5 if r.confirmed else 0.2)]
        born = [
            PaperTrack(z, self.sigma[sensor] ** 2 / max(score, 0.1), t, *self.prior)
            for z, score, sensor in (detections[k] for k in left)
        ]
        self.tracks = alive + born
