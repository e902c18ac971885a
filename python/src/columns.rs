//! Recordings in memory, whose columns are NumPy arrays that are not copied.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use muslip_recordings::load::Source;
use muslip_recordings::recording::{Memory, Recording, SharedColumn};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::failure::Failure;
use crate::job::{self, guarded};
use crate::rig::map_of;

/// An array of Python's, kept alive and read in place.
struct ArrayColumn {
    _owner: Py<PyAny>,
    start: *const f64,
    rows: usize,
}

// SAFETY: the memory belongs to an array that the owner keeps alive, and is only read here. As with every NumPy function that lets go of
// the lock, whoever writes into an array while it is computed on gets some of both; f64 has no bit pattern that is not a number.
#[expect(unsafe_code, reason = "memory of Python's, read in place")]
unsafe impl Send for ArrayColumn {}
// SAFETY: as above.
#[expect(unsafe_code, reason = "memory of Python's, read in place")]
unsafe impl Sync for ArrayColumn {}

impl AsRef<[f64]> for ArrayColumn {
    #[expect(unsafe_code, reason = "memory of Python's, read in place")]
    fn as_ref(&self) -> &[f64] {
        // SAFETY: `shared` checked that as many f64 lie there in a row, aligned, and the owner keeps them.
        unsafe { std::slice::from_raw_parts(self.start, self.rows) }
    }
}

/// A one-dimensional array of f64 without gaps, by what it says of itself (`__array_interface__`, version 3).
pub(crate) fn shared(array: &Bound<'_, PyAny>) -> PyResult<SharedColumn> {
    let refuse = |why: &str| Failure::Other(format!("an array cannot be read: {why}"));
    let says = array.getattr("__array_interface__")?;
    let says = says.cast::<PyDict>().map_err(|_| refuse("no interface"))?;
    let get = |key: &str| says.get_item(key)?.ok_or_else(|| refuse(key).into());
    let kind: String = PyResult::<Bound<'_, PyAny>>::and_then(get("typestr"), |t| t.extract())?;
    let (rows,): (usize,) =
        PyResult::<Bound<'_, PyAny>>::and_then(get("shape"), |shape| shape.extract())?;
    let (start, _): (usize, bool) =
        PyResult::<Bound<'_, PyAny>>::and_then(get("data"), |data| data.extract())?;
    let native = if cfg!(target_endian = "little") {
        "<f8"
    } else {
        ">f8"
    };
    if kind != native {
        return Err(refuse(&format!("its type is {kind}, not float64")).into());
    }
    let strides = says.get_item("strides")?;
    if let Some(strides) = strides.filter(|strides| !strides.is_none()) {
        let (stride,): (isize,) = strides.extract()?;
        if stride != 8 && rows > 1 {
            return Err(refuse("it has gaps").into());
        }
    }
    if rows == 0 {
        return Ok(Arc::new(Vec::new()));
    }
    if start == 0 || start % align_of::<f64>() != 0 {
        return Err(refuse("it is not aligned").into());
    }
    Ok(Arc::new(ArrayColumn {
        _owner: array.clone().unbind(),
        start: start as *const f64,
        rows,
    }))
}

/// Numbers as bytes, for `numpy.frombuffer`.
pub(crate) fn bytes<'py>(py: Python<'py>, values: &[f64]) -> PyResult<Bound<'py, PyBytes>> {
    PyBytes::new_with(py, size_of_val(values), |out| {
        for (to, value) in out.chunks_exact_mut(8).zip(values) {
            to.copy_from_slice(&value.to_ne_bytes());
        }
        Ok(())
    })
}

/// A recording in memory.
#[pyclass(frozen, module = "muslip._native")]
pub(crate) struct Columns {
    pub(crate) memory: Memory,
}

#[pymethods]
impl Columns {
    /// Of arrays, which are not copied.
    #[staticmethod]
    fn of_arrays(
        name: PathBuf,
        names: Vec<String>,
        arrays: Vec<Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let columns: Vec<SharedColumn> = arrays.iter().map(shared).collect::<PyResult<_>>()?;
        let columns = names.into_iter().zip(columns).collect();
        Ok(guarded(|| {
            Ok(Self {
                memory: Memory::of_columns(&name, columns)?,
            })
        })?)
    }

    /// Of a file; it keeps the name that is given for it.
    #[staticmethod]
    #[pyo3(signature = (path, map=None, name=None))]
    fn read(
        py: Python<'_>,
        path: PathBuf,
        map: Option<(bool, String)>,
        name: Option<PathBuf>,
    ) -> PyResult<Self> {
        let memory = job::run(py, None, move |_| {
            let map = map_of(map.as_ref())?;
            let name = name.unwrap_or_else(|| path.clone());
            let read = Recording::read_whole(&path, map.as_ref());
            read.map(|memory| memory.named(&name)).map_err(|mut error| {
                if error.path == path {
                    error.path = name;
                }
                error.into()
            })
        })?;
        Ok(Self { memory })
    }

    /// The same under another name.
    fn named(&self, name: PathBuf) -> Self {
        Self {
            memory: self.memory.clone().named(&name),
        }
    }

    #[getter]
    fn name(&self) -> String {
        self.memory.path().display().to_string()
    }

    #[getter]
    fn names(&self) -> Vec<String> {
        self.memory.header().names().to_vec()
    }

    #[getter]
    fn rows(&self) -> usize {
        self.memory.rows()
    }

    #[getter]
    fn notes(&self) -> Vec<String> {
        self.memory.notes().to_vec()
    }

    /// Where a column lies in memory: what is read is at the same place as what was given.
    fn address(&self, column: usize) -> Option<usize> {
        let column = self.memory.columns().get(column)?;
        Some(column.as_ref().as_ref().as_ptr() as usize)
    }

    /// A column as bytes.
    fn column<'py>(&self, py: Python<'py>, column: usize) -> PyResult<Bound<'py, PyBytes>> {
        let column = self.memory.columns().get(column);
        bytes(py, column.map_or(&[], |column| column.as_ref().as_ref()))
    }
}

/// A recording as Python hands it over: a path, or columns.
pub(crate) fn source(given: &Bound<'_, PyAny>) -> PyResult<Source> {
    match given.cast::<Columns>() {
        Ok(columns) => Ok(Source::Memory(columns.get().memory.clone())),
        Err(_) => Ok(Source::File(given.extract()?)),
    }
}

/// The last part of a path as it is printed in a command.
pub(crate) fn shown(path: &Path) -> String {
    path.display().to_string()
}
