"""What is in a recording, by rerun's own reader."""

import re
from collections import defaultdict

import numpy as np
from rerun.chunk import RrdReader


def prefix_of(label):
    """How the entities of one of several runs begin."""
    return "variants/" + re.sub(r"([^\w.-])", r"\\\1", label) + "/"


def rows(path, entity, static=False):
    """What an entity got by component, each in the order of ticks; and their ticks."""
    values_of, ticks = defaultdict(list), defaultdict(list)
    for chunk in RrdReader(path).stream().filter(content=f"/{entity}", is_static=static):
        batch = chunk.to_record_batch()
        tick = [0] * len(batch) if static else batch.column("tick").to_pylist()
        for field, values in zip(batch.schema, batch.columns, strict=True):
            if str(field.type).startswith("list"):
                values_of[field.name] += values.to_pylist()
                ticks[field.name] += tick
    orders = {name: np.argsort(tick, kind="stable") for name, tick in ticks.items()}
    sorted_ = {name: [values_of[name][i] for i in order] for name, order in orders.items()}
    return sorted_, {name: np.array(ticks[name])[order] for name, order in orders.items()}


def static(path, entity):
    """What stays the same at an entity, by component."""
    return {name: values[-1] for name, values in rows(path, entity, static=True)[0].items()}


def table(path, prefix="", component="columns"):
    """The columns of a run, or the curves that are only drawn, with their bits."""
    pieces = defaultdict(list)
    for chunk in RrdReader(path).stream().filter(content=f"/{prefix}columns", is_static=False):
        batch = chunk.to_record_batch()
        if component in batch.schema.names:
            struct, first = batch.column(component).flatten(), batch.column("tick")[0].as_py()
            for field in struct.type:
                values = struct.field(field.name)
                is_wide = field.type.num_fields > 0
                flat = np.asarray((values.flatten() if is_wide else values).to_numpy(zero_copy_only=False))
                pieces[field.name].append((first, flat.reshape(len(batch), -1) if is_wide else flat))
    return {name: np.concatenate([piece for _, piece in sorted(some, key=lambda piece: piece[0])])
            for name, some in pieces.items()}  # fmt: skip


def entities(path):
    """The paths of all entities."""
    return {chunk.entity_path for chunk in RrdReader(path).stream()}


def layout(path):
    """The one layout, its components by entity."""
    reader, tables = RrdReader(path), defaultdict(dict)
    (store,) = reader.blueprints()
    for chunk in reader.stream(store=store):
        batch = chunk.to_record_batch()
        for field, values in zip(batch.schema, batch.columns, strict=True):
            if ":" in field.name:
                tables[chunk.entity_path][field.name] = values.to_pylist()[-1]
    return tables


def plots(path):
    """Each plot by its title: range, and (entity, component, selector, names) of each of its visualizers."""
    tables, values_of = layout(path), {}
    for entity, about in tables.items():
        if about.get("ViewBlueprint:class_identifier") != ["TimeSeries"]:
            continue
        (range_,) = next(
            t["ScalarAxis:range"]
            for e, t in tables.items()
            if e.startswith(entity) and "ScalarAxis:range" in t
        )
        curves = []
        for below, other in tables.items():
            names = other.get("SeriesLines:names") or other.get("SeriesPoints:names")
            if below.startswith(f"{entity}/") and names:
                (source,) = other.get("VisualizerInstruction:component_map") or [{}]
                place = below.split("overrides/")[1].split("/visualizer")[0]
                curves.append((place, source.get("source_component"), source.get("selector"), tuple(names)))
        values_of[about["ViewBlueprint:display_name"][0]] = (entity, tuple(range_), curves)
    return values_of
