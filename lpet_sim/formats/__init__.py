"""Recordings in the formats of others, and back: ASL, KITTI, TUM, MCAP, Kalibr and Parquet."""
