//! What a layer holds.

use crate::crs::Crs;
use crate::table::Table;
use nalgebra::Point3;

/// A layer of features: row i of the table has geometry i.
#[derive(Clone, Debug)]
pub struct Layer {
    /// Table name in the file: letters, digits and underscores, not beginning with a digit.
    pub name: String,
    /// What a user reads in a list of layers.
    pub title: String,
    /// What the layer shows.
    pub description: String,
    /// Shape of the features.
    pub geometry: Geometry,
    /// Coordinate reference system; `None` for a local frame in metres.
    pub crs: Option<Crs>,
    /// Attributes; floats, integers, booleans and text.
    pub attributes: Table,
    /// Vertices of each feature; rings are closed on writing, the first vertex is not repeated. Empty: no
    /// geometry.
    pub vertices: Vec<Vec<Point3<f64>>>,
    /// Styles for QGIS; the first is the one that opens.
    pub styles: Vec<LayerStyle>,
}

/// Shape of the features of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Geometry {
    /// One ring, z kept.
    PolygonZ,
    /// One ring, z dropped.
    Polygon,
    /// An open line, z kept.
    LineStringZ,
    /// An open line, z dropped.
    LineString,
}

/// A style of a layer, as QGIS keeps it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LayerStyle {
    /// Name in QGIS's list of styles.
    pub name: String,
    /// What it shows.
    pub description: String,
    /// QGIS style document (QML).
    pub qml: String,
}
