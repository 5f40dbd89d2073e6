//! Mask R-CNN (He et al. 2017) on a feature pyramid (Lin et al. 2017), generic over burn's backends.
//!
//! Boxes are left, top, right, bottom; pixel (x, y) covers [x, x+1) x [y, y+1). Tensors are batch, channel,
//! row, column. What is small and full of decisions (anchors, matching, sampling, suppression) runs on plain
//! vectors.

mod anchors;
mod boxes;
mod config;
mod contrast;
mod fpn;
mod heads;
mod init;
mod kernels;
mod layers;
mod losses;
mod mask_rcnn;
mod matcher;
mod model_file;
mod nms;
mod paste;
mod preprocess;
mod resnet;
mod roi_align;
mod rpn;
mod sampler;
mod sparse;
mod targets;
mod weights;

pub use config::{
    AnchorConfig, BackboneConfig, ConfigError, MaskRcnnConfig, Norm, ProposalConfig, Resize, ResnetDepth,
    RoiConfig, SamplingConfig,
};
pub use kernels::{ModelBackend, TrainBackend};
pub use losses::Losses;
pub use mask_rcnn::{Instance, MaskRcnn, StoneDetector};
pub use model_file::{config_from_bytes, load_model, model_from_bytes, save_model};
pub use paste::paste_mask;
pub use sparse::SparseMatrix;
pub use weights::{
    Precision, WeightsError, load_weights, save_weights, weights_from_bytes, weights_to_bytes,
};
