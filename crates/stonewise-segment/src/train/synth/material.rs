//! What stones and mortar are made of: colour, texture and small-scale relief.

use super::draw::{Rng, between, chance, log_between, mix, normal, scaled, smoothstep, sometimes};
use super::noise::{Field, Grain};
use stonewise_core::raster::linear_from_srgb;

/// Colours of common building stones and bricks, sRGB 0 to 1, from which drawn colours depart.
const COMMON_COLOURS: [[f32; 3]; 14] = [
    [0.86, 0.85, 0.81], // white limestone
    [0.80, 0.74, 0.62], // cream limestone
    [0.76, 0.65, 0.48], // yellow sandstone
    [0.66, 0.54, 0.40], // brown sandstone
    [0.55, 0.37, 0.32], // red sandstone
    [0.45, 0.33, 0.34], // purple sandstone
    [0.58, 0.57, 0.55], // light granite
    [0.45, 0.45, 0.46], // grey gneiss
    [0.30, 0.30, 0.31], // basalt
    [0.42, 0.38, 0.33], // slate
    [0.50, 0.50, 0.42], // greenish schist
    [0.60, 0.31, 0.23], // red brick
    [0.47, 0.25, 0.20], // dark brick
    [0.74, 0.60, 0.40], // yellow brick
];

/// The stones' substance.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Mean colours, linear; every stone takes one of the one to six.
    pub colours: Vec<[f32; 3]>,
    /// Standard deviation of the logarithm of a stone's brightness, 0 to 0.35.
    pub tone_spread: f32,
    /// Standard deviation of the logarithm of a stone's brightness per colour channel, 0 to 0.1.
    pub hue_spread: f32,
    /// Brightness of blotches within a stone, 0 to 0.25.
    pub mottle: f32,
    /// Share of a second colour in blotches, 0 to 0.8.
    pub accent: f32,
    /// Width over which the second colour sets in, 0.05 (a sharp line) to 1.2, in deviations of the noise.
    pub accent_softness: f32,
    /// Brightness of veins through the stones, bright or dark, -0.5 to 0.6.
    pub veins: f32,
    /// Brightness of grain, 0 to 0.15.
    pub grain: f32,
    /// Size of the grain, 2 to 10 pixels.
    pub grain_px: f32,
    /// Brightness of bedding layers, 0 to 0.2.
    pub bedding: f32,
    /// Brightness of crystals, 0 to 0.2.
    pub speckle: f32,
    /// Radius of pits in parts of their spacing, 0 to 0.35.
    pub pits: f32,
    /// Spacing of pits, 4 to 30 pixels.
    pub pits_px: f32,
    /// Probability that a stone has a crack that ends inside it, 0 to 0.2.
    pub cracks: f32,
    /// Relief of the faces.
    pub relief: FaceRelief,
}

/// Relief of the stones' faces; lengths in parts of the stone's size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaceRelief {
    /// Height of the middle over the edge, 0 to 0.15.
    pub bulge: f32,
    /// Standard deviation of the roughness, 0 to 0.025.
    pub roughness: f32,
    /// Standard deviation of fine roughness, 0 to 0.35 pixels.
    pub fine_px: f32,
    /// Depth to which edges are worn off, 0 to 0.06.
    pub worn: f32,
    /// Standard deviation of the slope of whole faces, 0 to 0.12.
    pub tilt: f32,
    /// Standard deviation of the height of whole faces, 0 to 0.04.
    pub lift: f32,
    /// Width of a smooth margin around a rough face, 0 or 0.06 to 0.14.
    pub margin: f32,
    /// Depth of parallel tool marks, 0 to 0.5 pixels.
    pub tooling_px: f32,
    /// Slope of the planes of which a broken face consists, 0 (one plane) to 0.7.
    pub facets: f32,
}

/// What lies between the stones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mortar {
    /// Mean colour, linear.
    pub colour: [f32; 3],
    /// Width of the joints in parts of the stones' size, 0.006 to 0.14; hairlines are 0 to 1 pixel.
    pub width: f32,
    /// Variation of the width from stone to stone, in parts of it, 0 to 0.7.
    pub width_spread: f32,
    /// Depth below the faces in parts of the stones' size; below 0 where the mortar stands out, -0.01 to 0.1.
    pub recess: f32,
    /// How far mortar covers the stones' edges here and there, in parts of their size, 0 to 0.08.
    pub smear: f32,
    /// Brightness of blotches, 0 to 0.25.
    pub mottle: f32,
}

impl Material {
    /// A material drawn at random, from plain to busy.
    pub(super) fn random(rng: &mut Rng) -> Self {
        let busy = if chance(rng, 0.3) {
            between(rng, 0.05, 0.3)
        } else {
            1.0
        };

        // Fieldstones of every origin, or the stones of one or two quarries.
        let is_mixed = chance(rng, 0.3);
        let mut colours = vec![stone_colour(rng)];
        let others = if is_mixed {
            2 + (between(rng, 0.0, 4.0) as usize)
        } else {
            usize::from(chance(rng, 0.25)) + usize::from(chance(rng, 0.15))
        };

        for _ in 0..others {
            let other = mix(colours[0], stone_colour(rng), between(rng, 0.2, 1.0));
            colours.push(other);
        }

        let spread = if is_mixed {
            between(rng, 0.4, 1.0)
        } else {
            between(rng, 0.0, 1.0)
        };
        Self {
            colours,
            tone_spread: between(rng, 0.0, 0.35) * spread,
            hue_spread: between(rng, 0.0, if is_mixed { 0.1 } else { 0.05 }) * spread,
            mottle: busy * between(rng, 0.0, 0.25) * between(rng, 0.2, 1.0),
            accent: busy * sometimes(rng, 0.5, 0.1, 0.8),
            accent_softness: log_between(rng, 0.05, 1.2),
            veins: busy * sometimes(rng, 0.12, -0.5, 0.6),
            grain: busy * between(rng, 0.0, 0.15),
            grain_px: log_between(rng, 2.0, 10.0),
            bedding: busy * sometimes(rng, 0.35, 0.03, 0.2),
            speckle: busy * sometimes(rng, 0.3, 0.03, 0.2),
            pits: sometimes(rng, 0.35, 0.1, 0.35),
            pits_px: log_between(rng, 4.0, 30.0),
            cracks: sometimes(rng, 0.4, 0.0, 0.2),
            relief: FaceRelief::random(rng),
        }
    }
}

impl FaceRelief {
    fn random(rng: &mut Rng) -> Self {
        // From sawn to rock-faced.
        let rough = between(rng, 0.0, 1.0);
        Self {
            bulge: rough * sometimes(rng, 0.6, 0.0, 0.15),
            roughness: 0.025 * rough * rough,
            fine_px: between(rng, 0.0, 0.35) * between(rng, 0.0, 1.0),
            worn: between(rng, 0.0, 0.06) * between(rng, 0.0, 1.0),
            tilt: rough * between(rng, 0.0, 0.12),
            lift: rough * between(rng, 0.0, 0.04),
            margin: sometimes(rng, 0.1, 0.06, 0.14),
            tooling_px: sometimes(rng, 0.2, 0.1, 0.5),
            facets: 0.0,
        }
    }
}

impl Mortar {
    /// Mortar drawn at random for a material and a stone size in pixels.
    pub(super) fn random(rng: &mut Rng, material: &Material, stone_px: f32) -> Self {
        let stone = material.colours.first().copied().unwrap_or([0.3; 3]);
        let grey = scaled([1.0, 0.96, 0.88], log_between(rng, 0.05, 0.7));
        let colour = match between(rng, 0.0, 1.0) {
            // The stones' own colour, up to a tenth.
            p if p < 0.35 => scaled(stone, between(rng, 0.88, 1.12)),
            p if p < 0.60 => mix(
                scaled(stone, between(rng, 1.1, 1.8)),
                grey,
                between(rng, 0.0, 0.6),
            ),
            p if p < 0.85 => mix(
                scaled(stone, between(rng, 0.35, 0.9)),
                grey,
                between(rng, 0.0, 0.6),
            ),
            _ => grey,
        };

        let hairline = chance(rng, 0.25);
        let width = if hairline {
            between(rng, 0.0, 1.0) / stone_px
        } else {
            log_between(rng, 0.006, 0.14).max(0.8 / stone_px)
        };
        let recess = match between(rng, 0.0, 1.0) {
            p if p < 0.3 => between(rng, -0.01, 0.005),
            p if p < 0.75 => between(rng, 0.005, 0.04),
            _ => between(rng, 0.03, 0.1),
        };

        Self {
            colour: colour.map(|c| c.clamp(0.01, 0.92)),
            width,
            width_spread: between(rng, 0.0, 0.7),
            recess,
            smear: if hairline {
                0.0
            } else {
                sometimes(rng, 0.35, 0.01, 0.08)
            },
            mottle: between(rng, 0.0, 0.25),
        }
    }
}

/// A stone's colour: one of the common ones or, now and then, any of low saturation; linear.
pub(super) fn stone_colour(rng: &mut Rng) -> [f32; 3] {
    let base = if chance(rng, 0.8) {
        let index = between(rng, 0.0, COMMON_COLOURS.len() as f32) as usize;
        COMMON_COLOURS[index.min(COMMON_COLOURS.len() - 1)]
    } else {
        let grey = between(rng, 0.25, 0.85);
        [0, 1, 2].map(|_| grey * between(rng, 0.88, 1.1))
    };
    let brightness = (0.15 * normal(rng)).exp();
    base.map(|c| {
        let tinted = c * brightness * (0.035 * normal(rng)).exp();
        linear_from_srgb(tinted.clamp(0.08, 0.95))
    })
}

/// The planes of a broken face: two to four that slope down to different sides.
fn facets(slope: f32, size: f32, rng: &mut Rng) -> Vec<[f32; 3]> {
    let first = between(rng, 0.0, std::f32::consts::TAU);
    let count = 2 + (between(rng, 0.0, 3.0) as usize);
    (0..count)
        .map(|k| {
            let turn = (k as f32 + between(rng, -0.3, 0.3)) / count as f32;
            let (sin, cos) = (first + std::f32::consts::TAU * turn).sin_cos();
            let slope = slope * between(rng, 0.2, 1.0);
            [slope * cos, slope * sin, slope * size * between(rng, -0.25, 0.25)]
        })
        .collect()
}

/// From 1 at 0 to 0 at 1 and beyond, level there.
fn falling(t: f32) -> f32 {
    let rest = (1.0 - t).max(0.0);
    rest * rest
}

/// What is drawn once for a stone.
pub(super) struct Look {
    colour: [f32; 3],
    accent: [f32; 3],
    /// Shift of the noise, so that neighbours do not continue each other's texture.
    shift: [f32; 2],
    slope: [f32; 2],
    lift: f32,
    roughness: f32,
    /// Slopes of the planes of a broken face and their heights in the middle, pixels; the lowest is seen.
    facets: Vec<[f32; 3]>,
    /// A crack: point, direction and how far it reaches beyond the point.
    crack: Option<[f32; 5]>,
    /// Additional retreat of the outline behind the middle of the joint, in parts of the joint's width.
    pub(super) retreat: f32,
}

/// Noise fields of a wall's materials, ready to be evaluated.
pub(super) struct Surface {
    material: Material,
    mortar: Mortar,
    accent: Field,
    coarse: Field,
    grain: Field,
    bedding: Field,
    speckle: Field,
    pits: Field,
    tooling: Field,
    smear: Field,
    mortar_blotches: Field,
}

impl Surface {
    pub(super) fn new(material: &Material, mortar: &Mortar, stone_px: f32, rng: &mut Rng) -> Self {
        let bed_angle = 0.15 * normal(rng);
        let bed_px = stone_px * between(rng, 0.05, 0.25);
        let tool_angle = between(rng, 0.0, std::f32::consts::PI);
        let tool_px = log_between(rng, 3.0, 10.0);
        let coarse_px = stone_px * log_between(rng, 0.25, 1.2);
        let smear_px = stone_px * log_between(rng, 0.25, 2.0);
        Self {
            accent: Field::isotropic(rng, Grain::Fractal, 1.3 * stone_px),
            coarse: Field::isotropic(rng, Grain::Fractal, coarse_px),
            grain: Field::isotropic(rng, Grain::Fractal, 4.0 * material.grain_px),
            bedding: Field::new(rng, Grain::Fractal, [8.0 * bed_px, bed_px], bed_angle),
            speckle: Field::isotropic(rng, Grain::Smooth, 0.8 * material.grain_px),
            pits: Field::isotropic(rng, Grain::Cells, material.pits_px),
            tooling: Field::new(rng, Grain::Smooth, [12.0 * tool_px, tool_px], tool_angle),
            smear: Field::isotropic(rng, Grain::Fractal, smear_px),
            mortar_blotches: Field::isotropic(rng, Grain::Fractal, 14.0),
            material: material.clone(),
            mortar: *mortar,
        }
    }

    /// The look of one stone about `centre`, of a size in pixels.
    pub(super) fn look(&self, centre: [f32; 2], size: f32, rng: &mut Rng) -> Look {
        let material = &self.material;
        let pick = (between(rng, 0.0, material.colours.len() as f32)) as usize;
        let base = material
            .colours
            .get(pick)
            .or(material.colours.first())
            .copied()
            .unwrap_or([0.3; 3]);
        let tone = (material.tone_spread * normal(rng)).exp();
        let colour = base.map(|c| (c * tone * (material.hue_spread * normal(rng)).exp()).clamp(0.01, 0.95));
        let crack = chance(rng, material.cracks).then(|| {
            let angle = between(rng, 0.0, std::f32::consts::TAU);
            let from = [0, 1].map(|axis| centre[axis] + 0.2 * size * normal(rng));
            let (sin, cos) = angle.sin_cos();
            [from[0], from[1], cos, sin, size * between(rng, 0.0, 0.2)]
        });

        let shade = (0.3 * normal(rng)).exp();
        let facets = if material.relief.facets > 0.0 {
            facets(material.relief.facets, size, rng)
        } else {
            Vec::new()
        };

        Look {
            colour,
            accent: [0, 1, 2].map(|c: usize| {
                let other = base[c] * shade * (0.05 * normal(rng)).exp();
                other.clamp(0.01, 0.95)
            }),
            shift: [between(rng, 0.0, 4000.0), between(rng, 0.0, 4000.0)],
            slope: [0, 1].map(|_| material.relief.tilt * normal(rng)),
            lift: material.relief.lift * size * normal(rng),
            roughness: between(rng, 0.4, 1.4),
            facets,
            crack,
            retreat: self.mortar.width_spread * between(rng, -0.4, 1.0),
        }
    }

    /// How far mortar covers the stones here, pixels.
    #[inline]
    pub(super) fn smear(&self, u: f32, v: f32, stone_px: f32) -> f32 {
        if self.mortar.smear > 0.0 {
            self.mortar.smear * stone_px * self.smear.at(u, v).max(0.0)
        } else {
            0.0
        }
    }

    /// Albedo and height of a stone of a size, at a place `inside` pixels from its outline and `offset` from
    /// its centre.
    #[inline]
    pub(super) fn stone(
        &self,
        look: &Look,
        place: [f32; 2],
        offset: [f32; 2],
        inside: f32,
        size: f32,
    ) -> ([f32; 3], f32) {
        let (m, relief) = (&self.material, &self.material.relief);
        let (x, y) = (place[0] + look.shift[0], place[1] + look.shift[1]);
        let coarse = self.coarse.at(x, y);
        let grain = self.grain.at(x, y);
        let mut tone = 1.0 + m.mottle * coarse + m.grain * grain;
        let depth = inside.max(0.0);
        let rough = relief.roughness * look.roughness * size * coarse + relief.fine_px * grain;
        let rough = if relief.margin > 0.0 {
            rough * smoothstep(0.9 * relief.margin * size, 1.2 * relief.margin * size, depth)
        } else {
            rough
        };
        let mut height = look.lift
            + look.slope[0] * offset[0]
            + look.slope[1] * offset[1]
            + rough
            + relief.bulge * size * (1.0 - falling(depth / (0.45 * size)))
            - relief.worn * size * falling(depth / (0.15 * size));

        let planes = look.facets.iter();
        let lowest = planes
            .map(|p| p[0] * offset[0] + p[1] * offset[1] + p[2])
            .reduce(f32::min);
        height += lowest.unwrap_or(0.0);

        if m.bedding > 0.0 {
            let layer = self.bedding.at(x, y);
            tone += m.bedding * layer;
            height += 0.6 * relief.fine_px * layer;
        }

        if m.veins != 0.0 {
            tone *= 1.0 + m.veins * smoothstep(0.06, 0.02, self.accent.at(y, x).abs());
        }
        if m.speckle > 0.0 {
            tone += m.speckle * self.speckle.at(x, y);
        }

        if m.pits > 0.0 {
            let pit = smoothstep(m.pits, 0.5 * m.pits, self.pits.at(x, y)) * smoothstep(-0.3, 0.8, coarse);
            tone *= 1.0 - 0.5 * pit;
            height -= 0.15 * m.pits * m.pits_px * pit;
        }

        if relief.tooling_px > 0.0 {
            height += relief.tooling_px * self.tooling.at(x, y);
        }

        if let Some([px, py, dx, dy, beyond]) = look.crack {
            let (rx, ry) = (place[0] - px, place[1] - py);
            let along = rx * dx + ry * dy;
            let across = rx * dy - ry * dx + 0.05 * size * coarse;
            let width = 0.7 * smoothstep(beyond, beyond - 0.15 * size, along);
            let dark = smoothstep(width + 0.5, (width - 0.5).max(0.0), across.abs());
            tone *= 1.0 - 0.7 * dark * smoothstep(0.0, 0.3, width);
        }

        let colour = if m.accent > 0.0 {
            mix(
                look.colour,
                look.accent,
                m.accent
                    * smoothstep(
                        0.3 - 0.5 * m.accent_softness,
                        0.3 + 0.5 * m.accent_softness,
                        self.accent.at(x, y),
                    ),
            )
        } else {
            look.colour
        };

        (scaled(colour, tone.max(0.1)), height)
    }

    /// Albedo and height of the mortar, `outside` pixels from the next stone's outline.
    #[inline]
    pub(super) fn mortar(&self, u: f32, v: f32, outside: f32, stone_px: f32) -> ([f32; 3], f32) {
        let m = &self.mortar;
        let blotch = self.mortar_blotches.at(u, v);
        let fall = (0.35 * m.width * stone_px).max(0.6);
        let height = -m.recess * stone_px * smoothstep(-0.3 * fall, fall, outside) + 0.25 * blotch;
        (scaled(m.colour, (1.0 + m.mottle * blotch).max(0.1)), height)
    }

    /// Share of the sky's light that reaches the bottom of a joint: a trench seen from its middle.
    pub(super) fn joint_openness(&self, stone_px: f32) -> f32 {
        let depth = self.mortar.recess.max(0.0) * stone_px;
        let width = (self.mortar.width * stone_px).max(1.0);
        1.0 / (1.0 + (1.5 * depth / width).powi(2)).sqrt()
    }
}
