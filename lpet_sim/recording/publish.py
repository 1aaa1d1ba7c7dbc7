"""The last touch to a recording: its facts, its page of text, and the arrangement of its views."""

from __future__ import annotations

from lpet_sim.recording import layout
from lpet_sim.recording.blueprint import build_blueprint
from lpet_sim.recording.overview import Overview
from lpet_sim.recording.recording import Manifest
from lpet_sim.recording.store import StoreWriter
from lpet_sim.recording.visuals import Pen


def publish(store: StoreWriter, overview: Overview, manifest: Manifest) -> None:
    """Write the facts, the page and the blueprint of a recording that is otherwise complete."""
    store.send_json(layout.SUMMARY, overview.to_json())
    Pen(store.stream).document(layout.SUMMARY, overview.markdown(manifest))
    store.stream.send_blueprint(build_blueprint(overview))
