//! What is not masonry: sky, plants, ground, plaster, planks. Painted under or beside the walls.

use super::canvas::Canvas;
use super::draw::{Rng, between, chance, log_between, mix, normal, scaled, smoothstep, sometimes};
use super::material::stone_colour;
use super::noise::{Field, Grain};
use std::f32::consts::{FRAC_PI_2, PI};
use stonewise_core::raster::linear_from_srgb;

/// A surface without stones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Backdrop {
    /// What it is.
    pub kind: BackdropKind,
    /// Its mean colour, linear.
    pub colour: [f32; 3],
    /// Size of its coarsest texture, pixels, 6 to 200, in the sky 100 to 600.
    pub texture_px: f32,
    /// Strength of the texture, 0.3 to 1.5 of the kind's usual.
    pub strength: f32,
}

/// Kinds of surfaces without stones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BackdropKind {
    /// Sky, clear or with clouds; no shadows fall on it.
    Sky,
    /// Trees, bushes, ivy.
    Foliage,
    /// Grass, earth, sand, asphalt.
    Ground,
    /// Rendered or bare smooth wall with blotches, cracks and at times the lines of formwork.
    Plaster,
    /// Parallel boards, tiles or metal sheets.
    Planks,
    /// A dark opening.
    Void,
}

impl Backdrop {
    /// A surface of a kind, drawn at random.
    pub(super) fn of(kind: BackdropKind, rng: &mut Rng) -> Self {
        let grey = |value: f32| [linear_from_srgb(value); 3];
        let tinted = |base: [f32; 3], rng: &mut Rng| {
            let brightness = (0.25 * normal(rng) - 0.1).exp();
            base.map(|c| (linear_from_srgb(c) * brightness * (0.12 * normal(rng)).exp()).clamp(0.004, 1.1))
        };
        let colour = match kind {
            BackdropKind::Sky => mix(grey(0.97), [0.25, 0.45, 0.85], between(rng, 0.0, 0.9)),
            BackdropKind::Foliage => tinted([0.30, 0.38, 0.18], rng),
            BackdropKind::Ground => {
                let base = [
                    [0.42, 0.46, 0.25],
                    [0.55, 0.46, 0.36],
                    [0.82, 0.73, 0.60],
                    [0.42, 0.42, 0.43],
                ];
                let pick = (between(rng, 0.0, 4.0) as usize).min(3);
                tinted(base[pick], rng)
            }
            BackdropKind::Plaster => {
                if chance(rng, 0.5) {
                    stone_colour(rng)
                } else {
                    tinted([0.88, 0.86, 0.80], rng)
                }
            }
            BackdropKind::Planks => tinted([0.50, 0.38, 0.28], rng),
            BackdropKind::Void => tinted([0.08, 0.08, 0.09], rng),
        };

        Self {
            kind,
            colour,
            texture_px: match kind {
                BackdropKind::Sky => log_between(rng, 100.0, 600.0),
                _ => log_between(rng, 6.0, 200.0),
            },
            strength: between(rng, 0.3, 1.5),
        }
    }

    /// Any kind, drawn at random.
    pub(super) fn random(rng: &mut Rng) -> Self {
        let kind = match between(rng, 0.0, 1.0) {
            p if p < 0.22 => BackdropKind::Sky,
            p if p < 0.46 => BackdropKind::Foliage,
            p if p < 0.70 => BackdropKind::Ground,
            p if p < 0.86 => BackdropKind::Plaster,
            p if p < 0.94 => BackdropKind::Planks,
            _ => BackdropKind::Void,
        };
        Self::of(kind, rng)
    }

    /// Paints the surface where `region` holds.
    pub(super) fn paint(&self, canvas: &mut Canvas, region: &[bool], rng: &mut Rng) {
        let texture = Texture::new(self, canvas.photo_size(), rng);
        for y in 0..canvas.height {
            for x in 0..canvas.width {
                let i = y * canvas.width + x;
                if !region[i] {
                    continue;
                }
                let (colour, height) = texture.at(canvas.photo(x, y));
                canvas.albedo[i] = colour;
                canvas.relief[i] = height;
                canvas.openness[i] = 1.0;
                canvas.facing[i] = 1.0;
                canvas.label[i] = 0;
                canvas.doubtful[i] = false;
                canvas.piece[i] = canvas.current;
                canvas.sky[i] = self.kind == BackdropKind::Sky;
            }
        }
    }
}

/// A surface with what is drawn once for it.
struct Texture<'a> {
    backdrop: &'a Backdrop,
    /// Width and height of the photo, pixels.
    size: [f32; 2],
    coarse: Field,
    fine: Field,
    leaves: Field,
    stripe_px: f32,
    /// Sine and cosine of the direction across stripes.
    across: [f32; 2],
    stripes: bool,
    crack: Field,
    cracked: bool,
    clouds: bool,
    /// Size of pebbles in parts of their spacing, 0 for none.
    pebbles: f32,
    blotches: f32,
    gravel: Field,
}

impl<'a> Texture<'a> {
    fn new(backdrop: &'a Backdrop, size: [f32; 2], rng: &mut Rng) -> Self {
        let texture_px = backdrop.texture_px;
        let tilt = 0.2 * normal(rng);
        let coarse = match backdrop.kind {
            BackdropKind::Ground => Field::new(rng, Grain::Fractal, [3.0 * texture_px, texture_px], tilt),
            _ => Field::isotropic(rng, Grain::Fractal, texture_px),
        };
        let fine = Field::isotropic(rng, Grain::Fractal, 10.0);
        let leaves = Field::sized(rng, Grain::Cells, 3.0, 14.0);
        let stripe_px = log_between(rng, 10.0, 80.0);
        let stripe_angle = tilt + if chance(rng, 0.5) { FRAC_PI_2 } else { 0.0 };
        Self {
            backdrop,
            size,
            coarse,
            fine,
            leaves,
            stripe_px,
            across: stripe_angle.sin_cos().into(),
            stripes: chance(rng, 0.35),
            crack: Field::sized(rng, Grain::Fractal, 80.0, 400.0),
            cracked: chance(rng, 0.4),
            clouds: chance(rng, 0.5),
            pebbles: sometimes(rng, 0.35, 0.1, 0.5),
            blotches: log_between(rng, 0.05, 0.6),
            gravel: Field::sized(rng, Grain::Cells, 5.0, 40.0),
        }
    }

    /// Colour and height at a place of the photo.
    #[inline]
    fn at(&self, [px, py]: [f32; 2]) -> ([f32; 3], f32) {
        let base = self.backdrop.colour;
        let rough = self.backdrop.strength * self.coarse.at(px, py);
        let grain = self.backdrop.strength * self.fine.at(px, py);
        // Distance to the nearest line between boards, in parts of their width.
        let [sin, cos] = self.across;
        let board = (px * cos + py * sin) / self.stripe_px;
        let seam = (board - board.round()).abs() * self.stripe_px;

        match self.backdrop.kind {
            BackdropKind::Sky => {
                let cloud = if self.clouds {
                    smoothstep(0.0, 2.0, rough)
                } else {
                    0.0
                };
                let fade = 0.75 + 0.4 * py / self.size[1];
                (mix(scaled(base, fade), [1.1; 3], cloud), 0.0)
            }
            BackdropKind::Foliage => {
                let leaf = self.leaves.at(px, py);
                let tone = (0.5 * rough + 0.2 * grain).exp() * (1.4 - leaf);
                (scaled(base, tone.clamp(0.05, 3.0)), 2.0 * rough - 1.5 * leaf)
            }
            BackdropKind::Ground => {
                let (pebble, height) = self.pebble(px, py, grain);
                let tone = (self.blotches * rough + 0.12 * grain).exp() + 0.2 * pebble;
                (scaled(base, tone.clamp(0.2, 3.0)), 0.25 * grain + height)
            }
            BackdropKind::Plaster => {
                let line = self.cracked && self.crack.at(px, py).abs() < 0.012;
                let formwork = self.stripes && seam < 0.6;
                let dark = if line || formwork { 0.55 } else { 1.0 };
                let tone = dark * (1.0 + 0.06 * rough + 0.03 * grain);
                (scaled(base, tone.max(0.2)), 0.12 * grain)
            }
            BackdropKind::Planks => {
                let own = (board.round() * 1.7 + 3.0).sin() * 0.25;
                let dark = smoothstep(0.3, 1.5, seam);
                let tone = (0.3 + 0.7 * dark) * (1.0 + own + 0.1 * rough);
                (scaled(base, tone.max(0.1)), 1.5 * dark)
            }
            BackdropKind::Void => (scaled(base, (0.4 * rough).exp()), 0.0),
        }
    }

    /// How much a pebble covers a place, 0 to 1, and its height.
    #[inline]
    fn pebble(&self, px: f32, py: f32, grain: f32) -> (f32, f32) {
        if self.pebbles <= 0.0 {
            return (0.0, 0.0);
        }
        let place = self.gravel.at(px, py) + 0.05 * grain;
        let pebble = smoothstep(self.pebbles, 0.6 * self.pebbles, place);
        (pebble, 3.0 * self.pebbles * pebble)
    }
}

/// A random direction of boards, pipes and the like: upright or level, slightly out of true, or any.
pub(super) fn building_angle(rng: &mut Rng) -> f32 {
    let base = match between(rng, 0.0, 1.0) {
        p if p < 0.55 => 0.0,
        p if p < 0.85 => FRAC_PI_2,
        _ => between(rng, 0.0, PI),
    };
    base + 0.05 * normal(rng)
}
