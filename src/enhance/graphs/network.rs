//! Built-in network that is not an enhancer: [`Network`].

use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex, PoisonError};

use ort::session::{Session, SessionInputValue};
use ort::value::Tensor;

use darkqa_base::error::{Error, Result};

use super::session::{one_line, session_builder};
use crate::failure::describe_load_failure;
use crate::libraries::Runtime;

/// A loaded network with one input and any number of outputs, all of 32-bit floats. It runs on one thread, so that its
/// outputs do not depend on the number of cores.
pub struct Network {
    name: &'static str,
    runtime: Runtime,
    session: Arc<Mutex<Session>>,
}

impl Network {
    /// Loads a network from the content of its ONNX file; `name` names it in errors.
    ///
    /// # Errors
    /// If ONNX Runtime refuses it.
    pub fn open(name: &'static str, model: &'static [u8], runtime: &Runtime) -> Result<Self> {
        // A thread of its own, so that enhancers can run at the same time.
        let runtime = runtime.with_new_thread()?;
        let environment = runtime.environment().clone();
        let session = runtime
            .thread()
            .run(move || session_builder(&environment, Some(NonZeroUsize::MIN))?.commit_from_memory(model))?
            .map_err(|e| {
                let problem = describe_load_failure(&one_line(&e), runtime.version());
                Error::Runtime(format!("{name}: {problem}"))
            })?;
        Ok(Self { name, session: Arc::new(Mutex::new(session)), runtime })
    }

    /// Runs the network on an input of these dimensions. Returns the outputs in the order of the graph, each flattened
    /// row by row.
    ///
    /// # Errors
    /// If the run fails, for example because memory is exhausted.
    pub fn run(&self, dims: Vec<usize>, input: Vec<f32>) -> Result<Vec<Vec<f32>>> {
        let session = Arc::clone(&self.session);
        self.runtime
            .thread()
            .run(move || {
                let mut session = session.lock().unwrap_or_else(PoisonError::into_inner);
                let input = SessionInputValue::from(Tensor::from_array((dims, input))?);
                let outputs = session.run([input])?;
                outputs
                    .values()
                    .map(|output| Ok(output.try_extract_tensor::<f32>()?.1.to_vec()))
                    .collect::<ort::Result<_>>()
            })?
            .map_err(|e| Error::Runtime(format!("{}: {}", self.name, one_line(&e))))
    }
}
