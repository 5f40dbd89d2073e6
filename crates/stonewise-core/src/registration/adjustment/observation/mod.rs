//! What is observed of the stones' motions. Each type of observation is a folder that hands over normal
//! equations.

mod normal_equations;
pub(crate) mod photo;
pub(crate) mod surface;

pub(crate) use normal_equations::NormalEquations;
