//! Mask R-CNN (He et al. 2017) on a feature pyramid (Lin et al. 2017).
//!
//! Boxes are left, top, right, bottom; pixel (x, y) covers [x, x+1) x [y, y+1). Tensors are batch, channel,
//! row, column. What is small and full of decisions (anchors, matching, sampling, suppression) runs on plain
//! vectors.

mod activation;
mod anchors;
mod backbone;
mod boxes;
mod config;
mod contrast;
mod efficientnet_lite;
mod fpn;
mod gradients;
mod heads;
mod init;
mod layers;
mod learn;
mod losses;
mod mask_rcnn;
mod matcher;
mod model_file;
mod nms;
mod parameter;
mod paste;
mod preprocess;
mod relief_stem;
mod resnet;
mod roi_align;
mod rpn;
mod sampler;
mod targets;
#[cfg(test)]
mod tests;
mod weights;

pub use config::{
    AnchorConfig, BackboneConfig, ConfigError, MaskRcnnConfig, Norm, ProposalConfig, Resize, ResnetConfig,
    ResnetDepth, RoiConfig, SamplingConfig,
};
pub use gradients::Gradients;
pub use losses::Losses;
pub use mask_rcnn::{Instance, MaskRcnn};
pub use model_file::{config_from_bytes, model_from_bytes, save_model};
#[cfg(test)]
pub(crate) use parameter::Param;
pub(crate) use parameter::Parameters;
pub use paste::paste_mask;
pub use weights::{
    Precision, WeightsError, load_weights, save_weights, weights_from_bytes, weights_to_bytes,
};
