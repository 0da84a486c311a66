"""Records by a law, with scatter from run to run and noise."""

import numpy as np

CHANNELS, SAMPLES = 3, 40


def law(ratio, speed):
    """Three decaying waves, bent in the ratio, louder and faster with the speed; shape (channels, samples)."""
    t = np.linspace(0, 1, SAMPLES)
    shapes = np.array([np.exp(-2 * t) * np.sin(2 * np.pi * (3 + k) * (1 + 0.1 * (speed - 3)) * t) for k in range(CHANNELS)])
    share = np.array([1 + ratio, 1 + 0.5 * ratio**2, 2 - 0.7 * ratio])[:, None]
    return (speed / 3) ** 1.2 * share * shapes


def draws(count, seed, speeds=(3.0, 3.0), scatter=0.02):
    """X, ratios and speeds; `scatter` of each channel's size from run to run, as packing and breakage make it."""
    rng = np.random.default_rng(seed)
    ratio, speed = rng.uniform(0, 1, count), rng.uniform(*speeds, count)
    size = 1 + scatter * rng.standard_normal((count, CHANNELS, 1))
    return np.stack([law(b, v) for b, v in zip(ratio, speed, strict=True)]) * size, ratio, speed


def noisy(X, db, seed=5):
    rms = np.sqrt(np.mean(X**2, axis=2, keepdims=True))
    return X + rms * 10 ** (-db / 20) * np.random.default_rng(seed).standard_normal(X.shape)
