//! What a Mask R-CNN looks like and how it is trained.

use serde::{Deserialize, Serialize};
use stonewise_core::raster::RELIEF_CHANNELS;

/// Layers of a residual network (He et al. 2016, table 1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ResnetDepth {
    /// 18 layers, basic blocks.
    R18,
    /// 34 layers, basic blocks.
    R34,
    /// 50 layers, bottleneck blocks.
    R50,
}

/// How the backbone's activations are normalised.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Norm {
    /// Batch normalisation with stored statistics that training leaves alone: for weights that come with
    /// statistics.
    FrozenBatch {
        /// Added to the variance.
        epsilon: f64,
    },
    /// Group normalisation (Wu & He 2018): for training from scratch with small batches.
    Group {
        /// Groups of channels.
        groups: usize,
    },
}

/// The network that turns images into features.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "backbone must be a residual network (depth R18, R34 or R50, width, norm) or an efficientnet_lite"
)]
pub enum BackboneConfig {
    /// A residual network.
    Resnet(ResnetConfig),
    /// EfficientNet-Lite (Tan & Le 2019, without squeeze-and-excitation). Training does not change its weights.
    EfficientNetLite {
        /// Which one: 0, 1 or 2.
        efficientnet_lite: usize,
    },
}

/// A residual network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ResnetConfig {
    /// Number of layers.
    pub depth: ResnetDepth,
    /// Channels of the first stage; 64 as published.
    pub width: usize,
    /// Normalisation.
    pub norm: Norm,
}

/// Reference boxes of the region proposal network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AnchorConfig {
    /// Square roots of the areas, pixels, at each of the five levels (strides 4, 8, 16, 32, 64).
    pub sizes: [Vec<f32>; 5],
    /// Height over width.
    pub aspect_ratios: Vec<f32>,
}

/// How many boxes the region proposal network hands on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProposalConfig {
    /// Best boxes of each level before suppression, in training and in use.
    pub before_nms: [usize; 2],
    /// Best boxes of an image after suppression, in training and in use.
    pub after_nms: [usize; 2],
    /// A box that overlaps a better one by more than this IoU is dropped.
    pub nms_iou: f32,
}

/// Which boxes a loss looks at.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SamplingConfig {
    /// Boxes of an image.
    pub count: usize,
    /// At most this share of them is positive.
    pub positive_share: f32,
    /// A box with at least this IoU with a stone is positive.
    pub positive_iou: f32,
    /// A box with less IoU with every stone is negative.
    pub negative_iou: f32,
}

/// The heads that look at one region each.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoiConfig {
    /// Cells along a side of what the box head sees.
    pub box_cells: usize,
    /// Cells along a side of what the mask head sees; its masks have twice as many.
    pub mask_cells: usize,
    /// Sampling points along a side of a cell.
    pub samples: usize,
    /// Half-pixel alignment of RoIAlign. torchvision's Mask R-CNN is without.
    pub half_pixel: bool,
    /// Channels of the box head's two layers.
    pub box_hidden: usize,
    /// Channels of each of the mask head's convolutions.
    pub mask_channels: Vec<usize>,
    /// Boxes in training.
    pub sampling: SamplingConfig,
}

/// Shrinks or enlarges an image before it is looked at, keeping its shape.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Resize {
    /// The shorter side becomes this long, pixels...
    pub shorter: usize,
    /// ... unless the longer side would become longer than this.
    pub longest: usize,
}

/// A Mask R-CNN.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MaskRcnnConfig {
    /// Classes, background included: 2 = background and stone.
    pub classes: usize,
    /// Mean of the pixel values, 0 to 1, taken off each channel.
    pub pixel_mean: [f32; 3],
    /// Each channel is divided by this.
    pub pixel_std: [f32; 3],
    /// Channels of [relief](stonewise_core::raster::ReliefMap) that the model takes beside colour, 0 where it
    /// has not learnt relief. In a residual network they have a convolution of their own, whose output is added to
    /// that of the colours: a wider first layer, of which colour alone uses its part. With EfficientNet-Lite they
    /// have a stem of their own, which takes relief of half the rows and columns and is joined at the feature pyramid.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub relief_channels: usize,
    /// Size at which images are looked at; `None` as they are.
    pub resize: Option<Resize>,
    /// Network that gives the features.
    pub backbone: BackboneConfig,
    /// Channels of the feature pyramid.
    pub fpn_channels: usize,
    /// Groups of channels of a group normalisation of pyramid and convolutional heads, which training from
    /// scratch needs (He et al. 2019); `None`: not normalised, as published.
    #[serde(default)]
    pub head_groups: Option<usize>,
    /// The convolution of the proposal network has a bias instead of a normalisation even with `head_groups`.
    #[serde(default, skip_serializing_if = "is_false")]
    pub plain_proposals: bool,
    /// Reference boxes.
    pub anchors: AnchorConfig,
    /// Reference boxes in training.
    pub anchor_sampling: SamplingConfig,
    /// Region proposals.
    pub proposals: ProposalConfig,
    /// Box and mask heads.
    pub roi: RoiConfig,
    /// Detections below this score are dropped.
    pub score_threshold: f32,
    /// A detection that overlaps a better one of its class by more than this IoU is dropped.
    pub nms_iou: f32,
    /// Best detections of an image.
    pub detections: usize,
    /// Stones of fewer pixels are left out of training.
    pub min_stone_pixels: usize,
}

/// An impossible configuration of the model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("model configuration: {0}")]
pub struct ConfigError(String);

impl MaskRcnnConfig {
    /// The model of torchvision's `maskrcnn_resnet50_fpn` with its released weights: 91 classes of COCO.
    pub fn torchvision_r50() -> Self {
        Self {
            classes: 91,
            pixel_mean: [0.485, 0.456, 0.406],
            pixel_std: [0.229, 0.224, 0.225],
            relief_channels: 0,
            resize: Some(Resize {
                shorter: 800,
                longest: 1333,
            }),
            backbone: BackboneConfig::Resnet(ResnetConfig {
                depth: ResnetDepth::R50,
                width: 64,
                norm: Norm::FrozenBatch { epsilon: 0.0 },
            }),
            fpn_channels: 256,
            head_groups: None,
            plain_proposals: false,
            anchors: AnchorConfig {
                sizes: [32.0, 64.0, 128.0, 256.0, 512.0].map(|size| vec![size]),
                aspect_ratios: vec![0.5, 1.0, 2.0],
            },
            anchor_sampling: SamplingConfig {
                count: 256,
                positive_share: 0.5,
                positive_iou: 0.7,
                negative_iou: 0.3,
            },
            proposals: ProposalConfig {
                before_nms: [2000, 1000],
                after_nms: [2000, 1000],
                nms_iou: 0.7,
            },
            roi: RoiConfig {
                box_cells: 7,
                mask_cells: 14,
                samples: 2,
                half_pixel: false,
                box_hidden: 1024,
                mask_channels: vec![256; 4],
                sampling: SamplingConfig {
                    count: 512,
                    positive_share: 0.25,
                    positive_iou: 0.5,
                    negative_iou: 0.5,
                },
            },
            score_threshold: 0.05,
            nms_iou: 0.5,
            detections: 100,
            min_stone_pixels: 1,
        }
    }

    /// A model that two CPU cores can train from scratch and a laptop can run; anchors for stones of 12 to
    /// 400 pixels.
    pub fn light() -> Self {
        Self {
            classes: 2,
            resize: None,
            backbone: BackboneConfig::Resnet(ResnetConfig {
                depth: ResnetDepth::R18,
                width: 64,
                norm: Norm::Group { groups: 16 },
            }),
            fpn_channels: 64,
            head_groups: Some(16),
            anchors: AnchorConfig {
                sizes: [16.0, 32.0, 64.0, 128.0, 256.0].map(|size| vec![size]),
                aspect_ratios: vec![0.5, 1.0, 2.0],
            },
            proposals: ProposalConfig {
                before_nms: [500, 1000],
                after_nms: [300, 600],
                nms_iou: 0.7,
            },
            roi: RoiConfig {
                half_pixel: true,
                box_hidden: 256,
                mask_channels: vec![64; 4],
                sampling: SamplingConfig {
                    count: 128,
                    ..Self::torchvision_r50().roi.sampling
                },
                ..Self::torchvision_r50().roi
            },
            detections: 400,
            min_stone_pixels: 24,
            ..Self::torchvision_r50()
        }
    }

    /// The model of `lab/detector` on EfficientNet-Lite`size`, of use only with weights from a file, because its
    /// backbone is never trained here.
    pub fn efficientnet_lite(size: usize) -> Self {
        Self {
            // Values 0 to 255 enter as (value - 127) / 128.
            pixel_mean: [127.0 / 255.0; 3],
            pixel_std: [128.0 / 255.0; 3],
            backbone: BackboneConfig::EfficientNetLite {
                efficientnet_lite: size,
            },
            fpn_channels: 96,
            plain_proposals: true,
            ..Self::light()
        }
    }

    /// Adds all channels of relief to the model's input.
    #[must_use]
    pub fn with_relief(self) -> Self {
        Self {
            relief_channels: RELIEF_CHANNELS,
            ..self
        }
    }

    /// Refuses configurations from which no model can be built.
    ///
    /// # Errors
    /// A number is out of range; the message names it.
    pub fn check(&self) -> Result<(), ConfigError> {
        let fail = |what: &str| Err(ConfigError(what.to_owned()));
        if self.classes < 2 {
            return fail("classes must be 2 or more (background is one)");
        }
        let resnet = match &self.backbone {
            BackboneConfig::Resnet(resnet) => Some(resnet),
            BackboneConfig::EfficientNetLite { efficientnet_lite } if *efficientnet_lite < 3 => None,
            BackboneConfig::EfficientNetLite { .. } => {
                return fail("backbone.efficientnet_lite must be 0, 1 or 2");
            }
        };
        if resnet.is_some_and(|resnet| resnet.width == 0)
            || self.fpn_channels == 0
            || self.roi.box_hidden == 0
        {
            return fail("backbone.width, fpn_channels and roi.box_hidden must be 1 or more");
        }
        if self.roi.mask_channels.is_empty() || self.roi.mask_channels.contains(&0) {
            return fail("roi.mask_channels must name one or more convolutions of 1 or more channels");
        }
        if self.roi.box_cells == 0 || self.roi.mask_cells == 0 || self.roi.samples == 0 {
            return fail("roi.box_cells, roi.mask_cells and roi.samples must be 1 or more");
        }

        let mut normalised = self.roi.mask_channels.clone();
        normalised.push(self.fpn_channels);
        let is_divided = |channels: &[usize], groups: usize| {
            groups > 0 && channels.iter().all(|channels| channels.is_multiple_of(groups))
        };
        if self
            .head_groups
            .is_some_and(|groups| !is_divided(&normalised, groups))
        {
            return fail("head_groups must divide fpn_channels and roi.mask_channels");
        }
        if let Some(ResnetConfig {
            width,
            norm: Norm::Group { groups },
            ..
        }) = resnet
        {
            normalised.push(*width);
            if !is_divided(&normalised, *groups) {
                return fail(
                    "norm.group.groups must divide backbone.width, fpn_channels and roi.mask_channels",
                );
            }
        }

        let per_level = self.anchors.sizes[0].len();
        if per_level == 0 || self.anchors.sizes.iter().any(|sizes| sizes.len() != per_level) {
            return fail("anchors.sizes must hold equally many sizes, one or more, at every level");
        }
        if self.anchors.aspect_ratios.is_empty() {
            return fail("anchors.aspect_ratios must not be empty");
        }
        if self.pixel_std.iter().any(|std| !std.is_finite() || *std <= 0.0) {
            return fail("pixel_std must be finite and above 0");
        }
        let is_frozen = resnet.is_some_and(|resnet| matches!(resnet.norm, Norm::FrozenBatch { .. }));

        if self.relief_channels != 0 && (self.relief_channels != RELIEF_CHANNELS || is_frozen) {
            return Err(ConfigError(format!(
                "relief_channels must be 0 or {RELIEF_CHANNELS}, the latter with group normalisation only"
            )));
        }

        if self
            .resize
            .is_some_and(|resize| resize.shorter == 0 || resize.longest == 0)
        {
            return fail("resize.shorter and resize.longest must be 1 or more");
        }

        Ok(())
    }

    /// Normalisation of pyramid and convolutional heads.
    pub(super) fn head_norm(&self) -> Option<Norm> {
        self.head_groups.map(|groups| Norm::Group { groups })
    }
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde hands over a reference")]
fn is_zero(channels: &usize) -> bool {
    *channels == 0
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde hands over a reference")]
fn is_false(flag: &bool) -> bool {
    !flag
}
