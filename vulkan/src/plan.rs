//! What an artefact demands of a device, and how its points are cut up: chunks whose buffers fit, dispatches of a chunk.
//! Calls no Vulkan.

use ash::vk;
use isograd_compiler::{Bindings, Column, ColumnType, Form, Manifest, Precision, Rate, Target};

use crate::{DeviceInfo, Settings, VulkanError};

/// Dispatches of a chunk, at most.
pub(crate) const DISPATCHES: u32 = 16;

/// A column: what it holds, and its number among those of its buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Place {
    pub(crate) scalar: ColumnType,
    pub(crate) column: u32,
}

/// An artefact's columns and where they are bound.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Layout {
    pub(crate) precision: Precision,
    pub(crate) entry: String,
    pub(crate) workgroup: u32,
    pub(crate) bindings: Bindings,
    /// Each input column in order, and whether it has an element for each point.
    pub(crate) inputs: Vec<(Place, Rate)>,
    /// Each output column in order.
    pub(crate) outputs: Vec<Place>,
}

/// How points are cut up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Cut {
    /// Points of a chunk, the last excepted.
    pub(crate) chunk: u32,
    /// Points of a dispatch, the last of a chunk excepted.
    pub(crate) dispatch: u32,
}

impl Layout {
    /// Reads a manifest.
    ///
    /// # Errors
    /// If this is no kernel for Vulkan, or the manifest contradicts itself.
    pub(crate) fn new(manifest: &Manifest) -> Result<Self, VulkanError> {
        if manifest.target != Target::Spirv {
            return Err(VulkanError::Unsupported(format!(
                "the artefact is compiled to `{}`; Vulkan takes `spirv`: compile it with `--target spirv`",
                manifest.target.name()
            )));
        }
        let buffers = match (manifest.form, manifest.buffers()) {
            (Form::Kernel, Some(buffers)) => buffers,
            _ => {
                return Err(VulkanError::Unsupported(
                    "the artefact is a library of functions, which a device cannot run: compile it with `--form kernel`"
                        .to_owned(),
                ));
            }
        };
        let precision = manifest.precision().ok_or_else(|| {
            VulkanError::Unsupported(format!("the manifest names no precision that there is: `{}`", manifest.precision))
        })?;
        let all = |ports: &[isograd_compiler::Port]| -> Vec<(Place, Rate)> {
            let place = |column: &Column| Place { scalar: column.scalar, column: column.offset };
            ports.iter().flat_map(|port| port.columns.iter().map(move |c| (place(c), port.rate))).collect()
        };
        let layout = Self {
            precision,
            entry: buffers.entry.clone(),
            workgroup: buffers.workgroup,
            bindings: buffers.bindings,
            inputs: all(&manifest.inputs),
            outputs: all(&manifest.outputs).into_iter().map(|(place, _)| place).collect(),
        };
        if buffers.element != precision.bytes() || !layout.is_consistent() {
            return Err(VulkanError::Unsupported(
                "the manifest contradicts itself: it is damaged, or of another version of the compiler".to_owned(),
            ));
        }
        Ok(layout)
    }

    /// Whether columns of each buffer are numbered through, and each buffer with columns is bound to a place of its own.
    fn is_consistent(&self) -> bool {
        let numbered = |columns: &mut dyn Iterator<Item = u32>| {
            let mut columns: Vec<u32> = columns.collect();
            columns.sort_unstable();
            columns.iter().copied().eq((0..).take(columns.len()))
        };
        let of = |rate| self.inputs.iter().filter(move |(_, r)| *r == rate).map(|(place, _)| place.column);
        let Bindings { set, inputs, outputs, call, uniforms } = self.bindings;
        let mut bound: Vec<u32> = [inputs, Some(outputs), Some(call), uniforms].into_iter().flatten().collect();
        let count = bound.len();
        bound.sort_unstable();
        bound.dedup();
        let zero_byte = self.entry.contains('\0');
        set == 0
            && self.workgroup > 0
            && !zero_byte
            && bound.len() == count
            && numbered(&mut of(Rate::Varying))
            && numbered(&mut of(Rate::Uniform))
            && numbered(&mut self.outputs.iter().map(|place| place.column))
            && inputs.is_some() == (self.columns(Rate::Varying) > 0)
            && uniforms.is_some() == (self.columns(Rate::Uniform) > 0)
    }

    /// How many input columns there are of a rate.
    pub(crate) fn columns(&self, rate: Rate) -> usize {
        self.inputs.iter().filter(|(_, r)| *r == rate).count()
    }

    /// Bytes of an element.
    pub(crate) const fn element(&self) -> u64 {
        self.precision.bytes() as u64
    }

    /// Bytes of a buffer with so many columns of so many elements.
    pub(crate) const fn bytes(&self, columns: usize, elements: u32) -> u64 {
        (columns as u64).saturating_mul(elements as u64).saturating_mul(self.element())
    }

    /// Whether the device has what the kernel needs, and how it takes points.
    ///
    /// # Errors
    /// If it has not.
    pub(crate) fn cut(
        &self,
        info: &DeviceInfo,
        limits: &vk::PhysicalDeviceLimits,
        settings: &Settings,
    ) -> Result<Cut, VulkanError> {
        let unsupported = |what: String| Err(VulkanError::Unsupported(format!("{} {what}", info.name)));
        if self.precision == Precision::F64 && !info.doubles {
            return unsupported(
                "does not compute with f64: compile the artefact in f32, or take another device".into(),
            );
        }
        let [width, ..] = limits.max_compute_work_group_size;
        let most = width.min(limits.max_compute_work_group_invocations);
        if self.workgroup > most {
            return unsupported(format!("takes workgroups of at most {most}; this kernel has {}", self.workgroup));
        }
        let widest = self.columns(Rate::Varying).max(self.outputs.len());
        let (widest_group, uniforms) = (self.bytes(widest, self.workgroup), self.bytes(self.columns(Rate::Uniform), 1));
        // Elements are counted in u32 by the kernel.
        let range = info.max_buffer.min(u64::from(u32::MAX) * self.element());
        if widest_group.max(uniforms) > range {
            let wanted = widest_group.max(uniforms);
            return unsupported(format!("takes buffers of at most {range} bytes; this kernel needs {wanted}"));
        }
        let (each, group) =
            (self.bytes(self.columns(Rate::Varying) + self.outputs.len(), 1), u64::from(self.workgroup));
        let groups = u64::from(settings.groups.min(info.max_groups).max(1));
        // A base and an invocation together stay within u32.
        let dispatch = groups.saturating_mul(group).min((1 << 26) / group * group);
        let fit = (settings.memory / each.max(1)).min(range / self.bytes(widest, 1).max(1));
        let chunk = fit.min(dispatch * u64::from(DISPATCHES)) / group * group;
        let narrow = |points: u64| u32::try_from(points).unwrap_or(u32::MAX);
        Ok(Cut { chunk: narrow(chunk.max(group)), dispatch: narrow(dispatch) })
    }
}
