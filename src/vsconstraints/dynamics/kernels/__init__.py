"""Compiled functions of an arm with mass.

- ``arm`` declares its arrays. ``inertia`` computes mass matrix and bias, ``drives`` the torques.
- ``substeps`` integrates the motion through a sampling period.
"""
