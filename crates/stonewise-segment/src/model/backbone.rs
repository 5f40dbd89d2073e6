//! The network that turns images and their relief into features.

use super::config::{BackboneConfig, MaskRcnnConfig};
use super::efficientnet_lite::{self, EfficientNetLite};
use super::init::Init;
use super::parameter::{Parameters, part};
use super::relief_stem::ReliefStem;
use super::resnet::{self, Resnet};
use crate::engine::Tensor;

/// One of the networks that a configuration can name.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant, reason = "a model has one backbone")]
pub enum Backbone {
    /// Relief is added at its first layer.
    Resnet(Resnet),
    /// Relief is added at the pyramid.
    EfficientNetLite(EfficientNetLite, Option<ReliefStem>),
}

/// Features of strides 4, 8, 16 and 32.
#[derive(Clone, Debug)]
pub struct Features {
    /// Of the images.
    pub images: [Tensor; 4],
    /// What relief adds to them in the pyramid; empty where it adds nothing.
    pub relief: Vec<Tensor>,
}

impl Backbone {
    /// `seed`: the one that `init` began with.
    pub fn new(init: &mut Init, config: &MaskRcnnConfig, seed: Option<u64>) -> Self {
        match &config.backbone {
            BackboneConfig::Resnet(resnet) => Self::Resnet(Resnet::new(init, resnet, config.relief_channels)),
            BackboneConfig::EfficientNetLite { efficientnet_lite } => {
                // Drawn at random even without a seed: a model whose file has no relief could not learn it from zeros.
                let drawn = &mut Init::new(Some(seed.unwrap_or_default()));
                let channels = config.relief_channels;
                let relief = (channels > 0).then(|| ReliefStem::new(drawn, channels, config.fpn_channels));
                Self::EfficientNetLite(EfficientNetLite::new(init, *efficientnet_lite), relief)
            }
        }
    }

    /// Whether relief makes a difference.
    pub fn takes_relief(&self) -> bool {
        match self {
            Self::Resnet(resnet) => resnet.takes_relief(),
            Self::EfficientNetLite(_, relief) => relief.is_some(),
        }
    }

    /// Number of columns of an image per column of its relief.
    pub fn relief_step(&self) -> usize {
        match self {
            Self::Resnet(_) => 1,
            Self::EfficientNetLite(..) => 2,
        }
    }

    /// Features of images [batch, 3, rows, columns] and, where there is any, their relief [batch, relief, rows /
    /// step, columns / step], which is zeros for images where it is not `present`.
    pub fn forward(&self, images: &Tensor, relief: Option<&Tensor>, present: &[bool]) -> Features {
        match self {
            Self::Resnet(resnet) => Features {
                images: resnet.forward(images, relief),
                relief: Vec::new(),
            },
            Self::EfficientNetLite(body, stem) => Features {
                images: body.forward(images),
                relief: match (stem, relief) {
                    (Some(stem), Some(relief)) => stem.forward(relief, present),
                    _ => Vec::new(),
                },
            },
        }
    }

    /// Moves stored statistics into the convolutions and makes these faster as long as the weights stay as
    /// they are.
    pub fn prepare(&mut self) {
        match self {
            Self::Resnet(resnet) => resnet.prepare(),
            Self::EfficientNetLite(_, relief) => relief.iter_mut().for_each(ReliefStem::prepare),
        }
    }

    /// Its parameters under its name.
    pub fn parameters<'a>(&'a mut self, name: &str, found: &mut Parameters<'a>) {
        let body_name = part(name, "body");
        match self {
            Self::Resnet(resnet) => resnet.parameters(&body_name, found),
            Self::EfficientNetLite(body, relief) => {
                body.parameters(&body_name, found);
                if let Some(relief) = relief {
                    relief.parameters(&part(name, "relief"), found);
                }
            }
        }
    }
}

/// Channels of the features.
pub fn channels(config: &BackboneConfig) -> [usize; 4] {
    match config {
        BackboneConfig::Resnet(resnet) => resnet::channels(resnet),
        BackboneConfig::EfficientNetLite { efficientnet_lite } => {
            efficientnet_lite::channels(*efficientnet_lite)
        }
    }
}
