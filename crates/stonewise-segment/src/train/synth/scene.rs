//! What is where in a photo: walls, surfaces without stones, and the borders between them.

use super::backdrop::{Backdrop, BackdropKind};
use super::canvas::Canvas;
use super::draw::{Rng, between, chance, log_between, normal, sometimes};
use super::layout::Bond;
use super::masonry::{Masonry, Ring};
use super::noise::{Field, Grain};
use super::view::{View, Viewpoint};
use super::wall::Wall;
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// Smallest and largest median size of a wall's stones, pixels; single stones are smaller and larger.
const STONE_PX: [f32; 2] = [18.0, 320.0];

/// A part of the photo and what fills it; later layers cover earlier ones.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Where it is.
    pub region: Region,
    /// What it is.
    pub content: Content,
}

/// What fills a part of a photo.
#[derive(Clone, Debug, PartialEq)]
pub enum Content {
    /// A surface without stones.
    Backdrop(Backdrop),
    /// A wall.
    Masonry(Box<Masonry>),
}

/// A part of a photo; positions in parts of its width and height.
#[derive(Clone, Debug, PartialEq)]
pub enum Region {
    /// The whole photo.
    Everywhere,
    /// One side of a line.
    Beside {
        /// A point of the line.
        through: [f32; 2],
        /// Direction from the line into the region, radians.
        angle: f32,
        /// Waviness of the border, pixels, 0 to 30.
        ragged_px: f32,
    },
    /// A convex polygon.
    Polygon(Vec<[f32; 2]>),
    /// Below a round arch: a disc and what stands under it.
    Arch {
        /// Middle of the disc.
        centre: [f32; 2],
        /// Its radius, pixels.
        radius_px: f32,
    },
}

impl Region {
    fn mask(&self, canvas: &Canvas, rng: &mut Rng) -> Vec<bool> {
        if *self == Self::Everywhere {
            return vec![true; canvas.label.len()];
        }
        let size = canvas.photo_size();
        let border = Field::isotropic(rng, Grain::Fractal, 80.0);
        let mut mask = Vec::with_capacity(canvas.label.len());
        for y in 0..canvas.height {
            for x in 0..canvas.width {
                mask.push(self.contains(canvas.photo(x, y), size, &border));
            }
        }
        mask
    }

    fn contains(&self, p: [f32; 2], size: [f32; 2], border: &Field) -> bool {
        match self {
            Self::Everywhere => true,
            Self::Beside {
                through,
                angle,
                ragged_px,
            } => {
                let (sin, cos) = angle.sin_cos();
                let inside = (p[0] - through[0] * size[0]) * cos + (p[1] - through[1] * size[1]) * sin;
                inside + ragged_px * border.at(p[0], p[1]) > 0.0
            }
            Self::Polygon(corners) => (0..corners.len()).all(|i| {
                let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
                let (ax, ay) = (a[0] * size[0], a[1] * size[1]);
                let (bx, by) = (b[0] * size[0], b[1] * size[1]);
                (bx - ax) * (p[1] - ay) - (by - ay) * (p[0] - ax) >= 0.0
            }),
            Self::Arch { centre, radius_px } => {
                let (dx, dy) = (p[0] - centre[0] * size[0], p[1] - centre[1] * size[1]);
                dx.hypot(dy) < *radius_px || (dy > 0.0 && dx.abs() < *radius_px)
            }
        }
    }
}

impl Layer {
    /// Median size of the layer's stones, pixels; infinite without stones.
    pub(super) fn stone_px(&self) -> f32 {
        match &self.content {
            Content::Backdrop(_) => f32::INFINITY,
            Content::Masonry(masonry) => masonry.wall.stone_px,
        }
    }

    /// Colour of the layer's stones or surface, linear.
    pub(super) fn colour(&self) -> [f32; 3] {
        match &self.content {
            Content::Backdrop(backdrop) => backdrop.colour,
            Content::Masonry(masonry) => masonry.wall.material.colours.first().copied().unwrap_or([0.3; 3]),
        }
    }

    /// Replaces the wall, if it is one, by one without mortar.
    pub(super) fn lay_dry(&mut self, rng: &mut Rng) {
        if let Content::Masonry(masonry) = &mut self.content {
            masonry.wall.lay_dry(rng);
        }
    }

    /// Paints the layer.
    pub(super) fn paint(&self, canvas: &mut Canvas, width: u32, height: u32, rng: &mut Rng) {
        let mask = self.region.mask(canvas, rng);
        match &self.content {
            Content::Backdrop(backdrop) => backdrop.paint(canvas, &mask, rng),
            Content::Masonry(masonry) => {
                let view = View::new(&masonry.viewpoint, width, height);
                masonry.paint(canvas, &view, &mask, rng);
            }
        }
    }
}

fn layer(region: Region, content: Masonry) -> Layer {
    Layer {
        region,
        content: Content::Masonry(Box::new(content)),
    }
}

fn backdrop(region: Region, backdrop: Backdrop) -> Layer {
    Layer {
        region,
        content: Content::Backdrop(backdrop),
    }
}

/// The layers of a photo drawn at random.
pub(super) fn random_layers(viewpoint: Viewpoint, width: u32, height: u32, rng: &mut Rng) -> Vec<Layer> {
    let shorter = width.min(height) as f32;
    let largest = STONE_PX[1].min(0.8 * shorter).max(STONE_PX[0]);
    let wall = Wall::random(rng, STONE_PX[0], largest);
    let stone_px = wall.stone_px;
    match between(rng, 0.0, 1.0) {
        p if p < 0.05 => bare(rng),
        p if p < 0.45 => vec![layer(Region::Everywhere, Masonry::plain(wall, viewpoint))],
        p if p < 0.70 => edged(wall, viewpoint, rng),
        p if p < 0.83 => cornered(wall, viewpoint, rng),
        p if p < 0.91 => arched(wall, viewpoint, shorter, rng),
        _ => ruins(viewpoint, stone_px.min(0.12 * shorter), rng),
    }
}

/// No stones at all: two surfaces.
fn bare(rng: &mut Rng) -> Vec<Layer> {
    vec![
        backdrop(Region::Everywhere, Backdrop::random(rng)),
        backdrop(border(rng), Backdrop::random(rng)),
    ]
}

/// A wall with something else beside it, at one or two of its sides.
fn edged(wall: Wall, viewpoint: Viewpoint, rng: &mut Rng) -> Vec<Layer> {
    let whole_stones = chance(rng, 0.4);
    if whole_stones {
        let content = Masonry {
            whole_stones,
            ..Masonry::plain(wall, viewpoint)
        };
        return vec![
            backdrop(Region::Everywhere, Backdrop::random(rng)),
            layer(border(rng), content),
        ];
    }
    let mut layers = vec![layer(Region::Everywhere, Masonry::plain(wall, viewpoint))];
    for _ in 0..1 + usize::from(chance(rng, 0.3)) {
        layers.push(backdrop(border(rng), Backdrop::random(rng)));
    }
    layers
}

/// Two walls that meet: at a corner of a building, or where another masonry begins.
fn cornered(wall: Wall, viewpoint: Viewpoint, rng: &mut Rng) -> Vec<Layer> {
    let other = if chance(rng, 0.5) {
        let own = Wall::random(rng, 0.6 * wall.stone_px, 1.6 * wall.stone_px);
        Wall {
            material: wall.material.clone(),
            mortar: wall.mortar,
            ..own
        }
    } else {
        Wall::random(rng, 0.6 * wall.stone_px, 1.6 * wall.stone_px)
    };
    let turned = Viewpoint {
        yaw: viewpoint.yaw + between(rng, -1.2, 1.2),
        ..viewpoint
    };
    let second = Masonry {
        facing: between(rng, 0.2, 1.3),
        ..Masonry::plain(other, if chance(rng, 0.6) { turned } else { viewpoint })
    };
    vec![
        layer(Region::Everywhere, Masonry::plain(wall, viewpoint)),
        layer(border(rng), second),
    ]
}

/// An arch of wedge-shaped stones in a wall, open or walled up.
fn arched(wall: Wall, viewpoint: Viewpoint, shorter: f32, rng: &mut Rng) -> Vec<Layer> {
    let viewpoint = Viewpoint {
        yaw: 0.3 * viewpoint.yaw,
        pitch: 0.3 * viewpoint.pitch,
        ..viewpoint
    };
    let centre = [between(rng, 0.1, 0.9), between(rng, 0.3, 1.2)];
    let radius_px = shorter * between(rng, 0.25, 0.8);
    let depth_px = radius_px * between(rng, 0.15, 0.45);
    let mut voussoirs = wall.clone();
    voussoirs.bond = Bond::Row {
        aspect: log_between(rng, 0.35, 1.2),
    };
    voussoirs.stone_px = depth_px;
    voussoirs.mortar.width *= (wall.stone_px / depth_px).min(1.0);

    let inside = if chance(rng, 0.25) {
        let content = Wall::random(rng, STONE_PX[0], wall.stone_px.max(STONE_PX[0] + 1.0));
        layer(
            Region::Arch { centre, radius_px },
            Masonry::plain(content, viewpoint),
        )
    } else {
        backdrop(Region::Arch { centre, radius_px }, Backdrop::random(rng))
    };
    let behind = if chance(rng, 0.3) {
        backdrop(Region::Everywhere, Backdrop::random(rng))
    } else {
        layer(Region::Everywhere, Masonry::plain(wall, viewpoint))
    };

    let ring = Masonry {
        whole_stones: true,
        ring: Some(Ring {
            centre,
            radius_px,
            depth_px,
        }),
        ..Masonry::plain(voussoirs, viewpoint)
    };
    vec![behind, inside, layer(Region::Everywhere, ring)]
}

/// Several low walls on the ground under the sky, near and far.
fn ruins(viewpoint: Viewpoint, stone_px: f32, rng: &mut Rng) -> Vec<Layer> {
    let horizon = between(rng, 0.05, 0.5);
    let mut layers = vec![
        backdrop(
            Region::Everywhere,
            Backdrop::of(
                if chance(rng, 0.5) {
                    BackdropKind::Sky
                } else {
                    BackdropKind::Foliage
                },
                rng,
            ),
        ),
        backdrop(
            Region::Beside {
                through: [0.5, horizon],
                angle: FRAC_PI_2 + 0.04 * normal(rng),
                ragged_px: between(rng, 0.0, 6.0),
            },
            Backdrop::of(BackdropKind::Ground, rng),
        ),
    ];

    let first = Wall::random(rng, 0.7 * stone_px, stone_px);
    let count = 2 + (between(rng, 0.0, 4.0) as usize);
    for k in 0..count {
        // From far to near: lower in the photo, with larger stones.
        let near = (k as f32 + between(rng, 0.0, 1.0)) / count as f32;
        let own = Wall::random(rng, stone_px * (0.7 + 0.6 * near), stone_px * (0.9 + 1.6 * near));
        let mut wall = own;
        if chance(rng, 0.7) {
            wall.material = first.material.clone();
            wall.mortar.colour = first.mortar.colour;
        }
        let (left, wide) = (between(rng, -0.2, 0.8), between(rng, 0.2, 0.8));
        let bottom = horizon + (1.05 - horizon) * near.max(0.1);
        let high = between(rng, 0.12, 0.5);
        let lean = 0.1 * normal(rng);
        let corners = vec![
            [left, bottom - high],
            [left + wide, bottom - high * (1.0 + lean)],
            [left + wide, bottom + 0.2 * lean],
            [left, bottom],
        ];
        let content = Masonry {
            facing: between(rng, 0.2, 1.3),
            whole_stones: chance(rng, 0.6),
            ..Masonry::plain(
                wall,
                Viewpoint {
                    roll: viewpoint.roll,
                    ..Viewpoint::random(rng)
                },
            )
        };
        layers.push(layer(Region::Polygon(corners), content));
    }

    layers
}

/// A border across the photo, mostly upright or level.
fn border(rng: &mut Rng) -> Region {
    let angle = match between(rng, 0.0, 1.0) {
        p if p < 0.3 => 0.0,
        p if p < 0.6 => PI,
        p if p < 0.75 => FRAC_PI_2,
        p if p < 0.9 => -FRAC_PI_2,
        _ => between(rng, 0.0, TAU),
    };
    Region::Beside {
        through: [between(rng, 0.15, 0.85), between(rng, 0.15, 0.85)],
        angle: angle + 0.08 * normal(rng),
        ragged_px: sometimes(rng, 0.4, 1.0, 30.0),
    }
}
