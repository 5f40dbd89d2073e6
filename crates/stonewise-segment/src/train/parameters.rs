//! The parameters of a module by name.

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::backend::{AutodiffBackend, Backend};
use burn::tensor::{Tensor, TensorData};
use std::collections::BTreeMap;

/// Gradients by the path of their parameter, each flattened to one dimension.
pub struct Gradients<B: Backend>(BTreeMap<String, Tensor<B, 1>>);

impl<B: Backend> Gradients<B> {
    /// The gradients of a module's parameters that a loss has left; parameters it does not depend on have
    /// none.
    pub fn of<A, M>(module: &M, gradients: &A::Gradients) -> Self
    where
        A: AutodiffBackend<InnerBackend = B>,
        M: Module<A>,
    {
        let mut collector = GradientCollector::<A> {
            path: Vec::new(),
            gradients,
            found: BTreeMap::new(),
        };
        module.visit(&mut collector);
        Self(collector.found)
    }

    /// Adds the gradients of another batch.
    pub fn add(&mut self, other: Self) {
        for (path, gradient) in other.0 {
            let sum = match self.0.remove(&path) {
                Some(sum) => sum + gradient,
                None => gradient,
            };
            self.0.insert(path, sum);
        }
    }

    /// Multiplies all gradients by a factor.
    pub fn scale(&mut self, factor: f64) {
        for gradient in self.0.values_mut() {
            *gradient = gradient.clone().mul_scalar(factor);
        }
    }

    /// Length of all gradients taken as one vector; not finite where one of them is not.
    pub fn norm(&self) -> f64 {
        let squares: Vec<Tensor<B, 1>> = self.0.values().map(|g| g.clone().powi_scalar(2).sum()).collect();
        if squares.is_empty() {
            return 0.0;
        }
        let squares = Tensor::cat(squares, 0).into_data().convert::<f32>();
        let sum: f64 = squares.iter::<f32>().map(f64::from).sum();
        sum.sqrt()
    }

    /// Takes the gradient of a parameter out.
    pub fn take(&mut self, path: &str) -> Option<Tensor<B, 1>> {
        self.0.remove(path)
    }
}

/// All float parameters of a module, trained or not, by path.
pub fn parameters<B: Backend, M: Module<B>>(module: &M) -> BTreeMap<String, TensorData> {
    let mut collector = ValueCollector {
        path: Vec::new(),
        found: BTreeMap::new(),
    };
    module.visit(&mut collector);
    collector.found
}

/// The module with its float parameters replaced by those of the same path.
///
/// # Errors
/// The path of a parameter that is missing or has another shape.
pub fn with_parameters<B: Backend, M: Module<B>>(
    module: M,
    values: &BTreeMap<String, TensorData>,
) -> Result<M, String> {
    let mut replacer = Replacer {
        path: Vec::new(),
        values,
        problem: None,
    };
    let module = module.map(&mut replacer);
    match replacer.problem {
        None => Ok(module),
        Some(path) => Err(path),
    }
}

struct GradientCollector<'a, A: AutodiffBackend> {
    path: Vec<String>,
    gradients: &'a A::Gradients,
    found: BTreeMap<String, Tensor<A::InnerBackend, 1>>,
}

impl<A: AutodiffBackend> ModuleVisitor<A> for GradientCollector<'_, A> {
    fn enter_module(&mut self, name: &str, _container: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _name: &str, _container: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<A, D>>) {
        if let Some(gradient) = param.val().grad(self.gradients) {
            let size = gradient.shape().num_elements();
            self.found.insert(self.path.join("."), gradient.reshape([size]));
        }
    }
}

struct ValueCollector {
    path: Vec<String>,
    found: BTreeMap<String, TensorData>,
}

impl<B: Backend> ModuleVisitor<B> for ValueCollector {
    fn enter_module(&mut self, name: &str, _container: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _name: &str, _container: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<B, D>>) {
        self.found.insert(self.path.join("."), param.val().into_data());
    }
}

struct Replacer<'a> {
    path: Vec<String>,
    values: &'a BTreeMap<String, TensorData>,
    problem: Option<String>,
}

impl<B: Backend> ModuleMapper<B> for Replacer<'_> {
    fn enter_module(&mut self, name: &str, _container: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _name: &str, _container: &str) {
        self.path.pop();
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<B, D>>) -> Param<Tensor<B, D>> {
        let path = self.path.join(".");
        let (id, tensor, mapper) = param.consume();
        let tensor = match self.values.get(&path) {
            Some(data) if data.shape == tensor.shape() => {
                let trained = tensor.is_require_grad();
                Tensor::from_data(data.clone(), &tensor.device()).set_require_grad(trained)
            }
            _ => {
                self.problem.get_or_insert(path);
                tensor
            }
        };
        Param::from_mapped_value(id, tensor, mapper)
    }
}
