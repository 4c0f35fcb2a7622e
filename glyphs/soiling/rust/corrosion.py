"""Rust: steel turns into more than twice its volume of oxide, which stays in the marks and flakes off the land.

    blister, hard shell      loose flake, lifted edge     rust packed in the mark
        __                      ____.                       stands proud
     .-'  '-.  powder          ====='  .__ laminas gone    .--.
    =========================  ====    |   .              /::::\\   ==========  scale in laminas
    ------.   .-----------.            '---'-. ,---------.      .------------  steel, lower and rough
           '-' pit          '---------.       V pits       \\____/
                                        '----'  run together

Mass is conserved: all rust was metal, `rust = ratio * loss`, minus the rust that washes away or falls off. The loss of
steel follows a fractal field over a local time that starts in nests; hollows lose less, because the rust packed in them
keeps the air out. Larger characters are assumed to be outdoors longer, so that lengths scale with their height.

Sources:
    - Volume per iron atom, steel 1: magnetite 2.1, goethite 2.9, lepidocrocite 3.1, akaganeite 3.5, from molar masses
      and the densities in Cornell and Schwertmann, "The Iron Oxides" (5.18, 4.26, 4.09, 3.56 g/cm3).
    - Adherent rust is about a fifth (21 %) of the iron lost, magnetite; the rest is loose lepidocrocite, goethite and
      akaganeite: Garcia, Morales, Barrero and Greneche, Corrosion Science 48 (2006).
    - Thick marine rust comes off in compact laminas: "Rust exfoliation on carbon steels in
      chloride-rich atmospheres", Corrosion Reviews 33 (2015).
    - Loss of steel in the first year, 0.08 to 0.2 mm by the sea (C5), up to 0.7 mm at worst (CX): ISO 9223.
    - 100 to 350 pits per cm2 on low carbon steel: Bhakta and Solomon, in Laycock, Cottis and Scarf, J. Electrochem.
      Soc. 137 (1990); their shapes (dish, ellipse, undercut): ASTM G46.
    - Corroded steel is fractal: Xu, Ren and Wang, PLOS ONE 10 (2015) e0131361.
    - A tubercle is a hard shell of magnetite around a soft core, which reaches into the pit: Ray, Lee, Little and
      Gerke, "The anatomy of tubercles", Materials and Corrosion 61 (2010).
    - Assumed, without a source: hardness of loose powder and flakes, their friction and their colours.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from glyphs.soiling.coat import Coat
from glyphs.soiling.rust.bumps import Bumps, scatter_bumps, union_mm
from glyphs.surface.noise import Field, share

_ORANGE, _BROWN, _BLACK = (0.36, 0.125, 0.035), (0.150, 0.058, 0.024), (0.046, 0.033, 0.026)


def rust(
    coat: Coat,
    amount: float,
    *,
    rng: np.random.Generator,
    ratio: float = 3.0,
    lamina: float = 0.28,  # thickness of a lamina, in depths of the marks: 0.02 to 0.12 mm
    hurst: float = 0.6,
    # earlier onset of rust in marks, standard deviations: cold work, and water that stands in them
    early: float = 0.7,
) -> Coat:
    """Let a part rust outdoors, in the worst case by the sea; see `glyphs.soiling.soils.SoilModel`."""
    from scipy.ndimage import gaussian_filter

    if amount <= 0.0:
        return coat
    deep = mark_depth_mm(coat)
    of_part = rng.uniform((0.75, 0.6, 0.5, 0.5, 0.5), (1.25, 1.4, 1.5, 1.5, 1.5))
    age = float(min(amount * of_part[0], 1.0))
    rough, mottle = _fractals(coat, 0.5, hurst, rng)
    flaky, packs = _fractals(coat, 0.9, 1.0, rng)
    hollow = np.clip((coat.brim_mm - coat.clean_mm) / np.float32(deep), 0.0, 1.0)
    late = np.float32(0.8) * packs[::-1, ::-1] + np.float32(0.6) * mottle - np.float32(early) * hollow
    pits = draw_pits(coat, rng)
    blisters = _draw_blisters(coat, rng)

    # the steel: pits, and a general loss over a local time that starts in nests and in pits
    pit = union_mm(coat, pits, age, rough) * np.float32(min(1.0, of_part[1]))
    time = np.maximum(1.2 * age + 0.6 * age**2 - 0.6 * share(late), 0.0)
    time += np.minimum(pit / np.float32(2.0 * deep), 0.3)
    loss = _general_loss(time, rough, hollow, deep)
    width = 0.06 * coat.height_mm * age / coat.pitch_mm
    blunted = gaussian_filter(coat.z_mm, width, mode="nearest", truncate=3.0)
    steel = coat.z_mm + np.minimum(1.5 * time, 1.0) * (blunted - coat.z_mm) - loss - pit

    # the rust: in laminas, packed in hollows and in blisters, with powder on top
    scale, fallen = _scale(ratio * loss, flaky, age * float(of_part[2]), lamina * deep)
    packed = _pack_hollows(coat, steel + scale, time * np.float32(of_part[3]), packs)
    dome = union_mm(coat, blisters, age, flaky) * np.float32(min(1.0, of_part[4]))
    dome, burst = _burst_blisters(dome, blisters, packs)
    thick = scale + packed + dome
    soft, hardness = _yielding_layer(thick, time, rough, burst, fallen, deep, lamina_mm=lamina * deep)
    rusty = np.minimum(thick / np.float32(0.1 * deep), 1.0)
    done = replace(
        coat,
        z_mm=steel + thick,
        soft_mm=coat.soft_mm + rusty * (soft - coat.soft_mm),
        hardness_mpa=np.where(soft > 0.0, hardness, coat.hardness_mpa),
        friction=coat.friction + rusty * (_friction(soft, deep) - coat.friction),
    )
    return _rusty_look(done, age, thick / np.float32(deep), time, fallen, packs, mottle)


def mark_depth_mm(coat: Coat) -> float:
    """Depth or height of the marks: 98 % quantile of the clean surface's distance from its brim."""
    off = np.abs(coat.clean_mm - coat.brim_mm)[::2, ::2]
    return max(float(np.quantile(off, 0.98)), 0.02 * coat.height_mm)


def draw_pits(coat: Coat, rng: np.random.Generator) -> Bumps:
    """Pits: log-normal in depth and width, 45 on a square of one character height (180 per cm2 at 5 mm)."""
    return scatter_bumps(coat, 45.0, rng, width=0.084, spread=0.4, slope=0.6, blunt=0.25, born=0.0)


def _draw_blisters(coat: Coat, rng: np.random.Generator) -> Bumps:
    return scatter_bumps(coat, 2.5, rng, width=0.22, spread=0.45, slope=0.3, blunt=0.6, born=0.1)


def _fractals(coat: Coat, outer: float, hurst: float, rng: np.random.Generator) -> tuple[Field, Field]:
    from scipy import fft

    length = outer * coat.height_mm / coat.pitch_mm
    room = min(int(0.5 * length), 2 * max(coat.shape))
    rows, cols = (int(fft.next_fast_len(n + room)) for n in coat.shape)
    row, col = (np.r_[0 : n // 4, -(n // 4) : 0] for n in (rows, cols))
    down, across = ((length / n * k).astype(np.float32) ** 2 for n, k in ((rows, row), (cols, col)))
    gain = (1.0 + down[:, None] + across[None, :]) ** np.float32(-0.5 * (1.0 + hurst))
    gain /= np.float32(np.sqrt(np.sum(gain * gain, dtype=np.float64)))
    white = rng.standard_normal((row.size, col.size, 2), dtype=np.float32).view(np.complex64)[..., 0]
    spectrum = np.zeros((rows, cols), dtype=np.complex64)
    spectrum[np.ix_(row, col)] = gain * white
    field = fft.ifft2(spectrum, norm="forward", overwrite_x=True)[: coat.shape[0], : coat.shape[1]]
    return np.ascontiguousarray(field.real), np.ascontiguousarray(field.imag)


def _general_loss(time: Field, rough: Field, hollow: Field, deep: float) -> Field:
    uneven = np.exp(0.5 * np.clip(rough, -2.5, 2.5))
    return np.asarray(np.float32(0.5 * deep) * time * uneven * (1.0 - 0.75 * hollow), dtype=np.float32)


def _scale(
    grown: Field,
    flaky: Field,
    spall: float,
    lamina_mm: float,
    *,
    stays: float = 0.55,
    adherent: float = 0.21,  # share of the rust that never flakes off
) -> tuple[Field, Field]:
    # scale left on the steel, mm, and number of fallen laminas (-1 at the loose, lifted edge of a flake)
    layers = grown * np.float32(stays / lamina_mm)
    least = grown * np.float32(adherent / lamina_mm)
    # the outer laminas fall first and leave terraces
    weak = np.float32(3.6 * min(spall, 1.0) - 3.0) - flaky
    fallen = 3.5 * np.maximum(weak, 0.0)
    left = np.maximum(layers - fallen, least)
    whole = np.floor(left)
    terrace = np.minimum(np.maximum(whole + np.clip(5.0 * (left - whole) - 4.0, 0.0, 1.0), least), layers)
    edge = np.clip(1.0 + 5.0 * weak, 0.0, 1.0) * np.minimum(layers, 1.0)
    gone = weak > 0.0
    scale_mm = np.where(gone, terrace, layers + 0.5 * edge) * np.float32(lamina_mm)
    return scale_mm, np.where(gone, np.minimum(fallen, layers), -(edge > 0.5).astype(np.float32))


def _pack_hollows(coat: Coat, top: Field, time: Field, packs: Field) -> Field:
    hollow = np.maximum(coat.brim_mm - top, 0.0)
    return np.asarray(hollow * np.minimum(0.95 * time * np.exp(0.5 * packs), 1.5), dtype=np.float32)


def _burst_blisters(dome: Field, blisters: Bumps, packs: Field) -> tuple[Field, Field]:
    if not blisters.height_mm.size:
        return dome, np.zeros_like(dome)
    high = np.float32(np.quantile(blisters.height_mm, 0.6))
    broken = np.clip((dome / high - 1.0) / 0.15, 0.0, 1.0) * np.clip(2.5 * packs, 0.0, 1.0)
    return dome - broken * 0.7 * np.maximum(dome - 0.5 * high, 0.0), broken


def _yielding_layer(
    thick: Field,
    time: Field,
    rough: Field,
    burst: Field,
    fallen: Field,
    deep: float,
    *,
    lamina_mm: float,
    powder_mpa: float = 8.0,
    flake_mpa: float = 40.0,
) -> tuple[Field, Field]:
    # thickness that yields, mm, and its hardness, MPa: powder, the soft core of a burst blister, a loose flake; powder
    # is at most the upper third of the rust, and crumbles under a fingernail, hard (Mohs 5) as its crystals are
    most = np.float32(0.12 * deep) * np.minimum(time, 1.0) * np.clip(1.0 + 0.4 * rough, 0.3, 2.0)
    powder = np.minimum(thick / 3.0, most * (1.0 + 3.0 * burst) / (1.0 + np.maximum(fallen, 0.0)))
    loose = np.minimum(thick, np.float32(lamina_mm)) * (fallen < 0.0)
    mpa = np.where(loose > powder, np.float32(flake_mpa), np.float32(powder_mpa))
    return np.asarray(np.maximum(powder, loose), dtype=np.float32), mpa


def _friction(soft: Field, deep: float, *, powder: float = 0.65, scale: float = 0.45) -> Field:
    dusty = np.minimum(soft / np.float32(0.02 * deep), 1.0)
    return np.asarray(scale + (powder - scale) * dusty, dtype=np.float32)


def _rusty_look(
    coat: Coat, age: float, thick: Field, time: Field, fallen: Field, packs: Field, mottle: Field
) -> Coat:
    film = np.float32(1.0 - 0.65 * min(1.0, 1.5 * age))
    cover = 1.0 - film * (1.0 - np.clip(9.0 * thick, 0.0, 1.0))
    bared = np.clip(0.25 * fallen + 0.125 * mottle, 0.0, 0.75)
    old = np.clip((time + 0.25 * mottle - 0.1) / 1.2, 0.0, 1.0)
    old *= 1.0 - np.clip((packs - 0.6 * mottle - 0.2) / 2.3, 0.0, 0.7)
    old *= 1.0 - bared
    grain = np.clip(1.0 + 0.18 * mottle, 0.5, 1.5)
    albedo = np.empty((*coat.shape, 3), dtype=np.float32)
    for i, (orange, brown, black) in enumerate(zip(_ORANGE, _BROWN, _BLACK, strict=True)):
        albedo[..., i] = grain * (orange + (brown - orange) * old + (black - orange) * bared)
    return coat.shaded(cover, albedo=albedo, roughness=0.9 - 0.2 * bared, reflectance=0.04)
