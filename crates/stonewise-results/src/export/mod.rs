//! Results as layers for the tools that engineers already use: QGIS, ParaView, CloudCompare, CAD.

mod drawing;
mod face_colours;
mod face_mesh;
mod joint_layer;
mod layer_style;
mod layers;
mod polygons;
mod write_layers;
mod zone_layers;

pub use face_colours::FaceColours;
pub use write_layers::write_layers;
