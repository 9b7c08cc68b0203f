"""Threads come back from wraps, whole wraps are predicted, and a neighbour's light is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fabricusd.appearance.surface import evaluate, mean_shadow
from fabricusd.errors import FabricError
from fabricusd.fabric import SURFACE_LAWS, even
from fabricusd.measure.cylinder.fit import fit_cylinders
from fabricusd.measure.cylinder.model import Model, numbers, require_template, worn
from fabricusd.measure.cylinder.problem import shown
from fabricusd.measure.cylinder.profile import FLOOR, RELATIVE, profile
from fabricusd.measure.cylinder.simulate import photographed, three_wraps
from fabricusd.measure.fit.parameters import volume_level
from fabricusd.schema import load

MASKED = SURFACE_LAWS[0]


def template_of(name="linen_plain", law=MASKED):
    return require_template(replace(load(name), surface_law=law), name)


def truth(template, names):
    return np.array(
        [
            1.0 if n.field == "curve" else getattr(template.thread_list[n.which], n.field)
            for n in names
        ]
    )


def wraps(template, noise=1.0, stray=0.0):
    """Profiles of three wraps by the law itself; stray : light from the right on the first."""
    stand = three_wraps()
    names = numbers(template, coverage=False)
    albedo = np.array([template.thread_list[k].albedo for k in worn(template)])
    rng = np.random.default_rng(0)
    made = []
    for cylinder in stand.cylinders:
        p = profile(np.ones((180, 720, 3)), stand, cylinder, 0, "ones")
        surface, volume = shown(Model(template), names, truth(template, names), [p])
        light = np.pi * (surface[:, None] + volume @ albedo)
        sigma = np.sqrt((RELATIVE * light) ** 2 + (FLOOR * light.max()) ** 2)
        if cylinder is stand.cylinders[0]:
            light = light + stray * light.mean() * np.clip(p.side - 0.5, 0, 1)[:, None]
        light = light + noise * sigma * rng.standard_normal(light.shape)
        made.append(replace(p, light=light, sigma=sigma))
    return made


@pytest.mark.parametrize(
    "law", [MASKED, *(pytest.param(law, marks=pytest.mark.exhaustive) for law in SURFACE_LAWS[1:3])]
)
def test_columns_add_up_to_the_law(law):
    template = template_of("silk_shot", law)
    names = numbers(template, coverage=False)
    p = profile(np.ones((180, 720, 3)), three_wraps(), three_wraps().cylinders[2], 0, "ones")
    wi, wo = p.wi[0], p.wo[0]
    surface, volume = Model(template).columns(names, truth(template, names), wi, wo)
    albedo = np.array([template.thread_list[k].albedo for k in worn(template)])
    wanted = evaluate(even(template), wi, wo, shadow=mean_shadow(template), max_error=1e-3)
    found = surface[:, None] + volume @ albedo
    assert np.abs(found - wanted).max() < 0.01 * wanted.max()


@pytest.mark.exhaustive
def test_on_a_cluster_the_fit_is_the_same_to_the_bit(cluster):
    template = template_of(law=SURFACE_LAWS[2])
    seen = wraps(template)
    here = fit_cylinders(template, seen, irradiance=np.pi)
    there = fit_cylinders(template, seen, irradiance=np.pi, scheduler=cluster)
    assert there.as_json() == here.as_json()


@pytest.mark.slow
def test_linen_comes_back_and_its_bias_is_predicted():
    template = template_of()
    made = fit_cylinders(template, wraps(template), irradiance=np.pi)
    names = numbers(template, coverage=False)
    found = [made.estimates[n.label] for n in names]
    held = [
        e.low <= t / n.scale <= e.high
        for e, n, t in zip(found, names, truth(template, names), strict=True)
    ]
    assert np.mean(held) >= 0.8
    assert made.estimates["Linen curve scale"].value == pytest.approx(1.0, abs=0.02)
    assert 0.8 < made.chi2 < 1.2
    bias = next(w for w in made.wraps if w.predicted)
    assert bias.name == "Bias"
    assert bias.mean < 1.0
    assert made.notes == () or not any("neighbour" in note for note in made.notes)


@pytest.mark.slow
def test_light_of_a_neighbour_is_named_with_its_side():
    template = template_of()
    made = fit_cylinders(template, wraps(template, noise=0.3, stray=0.3), irradiance=np.pi)
    said = [note for note in made.notes if "neighbour" in note]
    assert len(said) == 1
    assert "'Upright'" in said[0]
    assert "right" in said[0]
    assert "Round and Bias" in said[0]


@pytest.mark.exhaustive
def test_what_flannel_does_not_tell_apart_is_told_as_a_product():
    # Its light is wide: threads from kd .5 and gv 46 degrees to kd .9 and gv 12 are nearly alike.
    template = template_of("wool_flannel", SURFACE_LAWS[1])
    made = fit_cylinders(template, wraps(template, noise=2.0), irradiance=np.pi)
    thread = template.thread_list[0]
    assert made.estimates["Wool kd"].low <= thread.isotropic <= made.estimates["Wool kd"].high
    assert any("gv, kd and A cannot be told apart" in note for note in made.notes)
    level = volume_level(template.model_of(thread), thread.gamma_volume, thread.isotropic)
    assert len(made.products) >= 3
    for product, channel, albedo in zip(
        made.products, ("red", "green", "blue"), thread.albedo, strict=False
    ):
        assert product.low <= albedo * level <= product.high
        assert product.spread < 0.7 * made.estimates[f"Wool A {channel}"].spread


@pytest.mark.parametrize("name", ["linen_plain", "wool_flannel"])
def test_light_has_no_jumps_where_curves_are_scaled(name):
    # At 1 the pieces of the presets' curves are whole numbers of nodes long: one more beyond.
    template = template_of(name, load(name).surface_law)
    names = numbers(template, coverage=False)
    p = profile(np.ones((180, 720, 3)), three_wraps(), three_wraps().cylinders[0], 0, "ones")
    model, x = Model(template), truth(template, names)
    at = next(k for k, n in enumerate(names) if n.field == "curve")
    light = []
    for scale in (0.999, 1.0, 1.001):
        x[at] = scale
        light.append(sum(part.sum() for part in shown(model, names, x, [p])))
    low, middle, high = light
    assert abs(high - low) > 1e-5 * middle
    assert abs(low + high - 2 * middle) < 0.02 * abs(high - low)


def test_conserving_threads_are_refused():
    fabric = load("linen_plain")
    conserving = replace(fabric, model="conserving", surface_law="facets")
    with pytest.raises(FabricError, match="thesis or microcylinder"):
        require_template(conserving, "x")


def test_a_photograph_that_does_not_show_the_cylinders_is_refused():
    stand = three_wraps()
    with pytest.raises(FabricError, match="does not show all of 'Upright'"):
        profile(np.ones((720, 180, 3)), replace(stand, view_angle=0.1), stand.cylinders[0], 0, "x")


@pytest.mark.slow
def test_the_path_tracer_agrees_with_the_columns_across_every_wrap():
    template = template_of("silk_crepe_de_chine")
    stand = three_wraps()
    picture = photographed(template, stand, width=480, height=120, spp=16)
    names = numbers(template, coverage=False)
    albedo = np.array([template.thread_list[k].albedo for k in worn(template)])
    for cylinder in stand.cylinders:
        p = profile(picture, stand, cylinder, 0, "render")
        surface, volume = shown(Model(template), names, truth(template, names), [p])
        light = np.pi * (surface[:, None] + volume @ albedo)
        assert np.sqrt(((p.light - light) ** 2).mean()) < 0.01 * light.mean()
