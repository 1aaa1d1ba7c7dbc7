"""Pieces of `scenarios.kitti_prediction`."""
