"""The paper's way: Q, Kalman filter, fusion, function space, inverse solution."""
