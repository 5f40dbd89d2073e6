//! A detector small enough for tests.

use stonewise_segment::model::{BackboneConfig, MaskRcnnConfig, Norm, ResnetConfig, ResnetDepth, RoiConfig};

/// The light model with `width` channels, a multiple of 4, instead of 64.
pub fn narrow(width: usize) -> MaskRcnnConfig {
    let light = MaskRcnnConfig::light();
    MaskRcnnConfig {
        backbone: BackboneConfig::Resnet(ResnetConfig {
            depth: ResnetDepth::R18,
            width,
            norm: Norm::Group { groups: 4 },
        }),
        fpn_channels: width,
        head_groups: Some(4),
        roi: RoiConfig {
            box_hidden: 2 * width,
            mask_channels: vec![width],
            ..light.roi
        },
        ..light
    }
}
