//! An artefact as a pipeline of a device, and its evaluation over columns. Knows bindings; what lies in a column is the
//! business of `words`.

use std::ffi::CString;
use std::sync::Arc;

use ash::vk::{self, DescriptorType};
use isograd_compiler::{Manifest, Rate};
use isograd_runtime::{Column, Values, fits};

use crate::device::{Core, Owned};
use crate::dispatch::{CALL_BYTES, Chunk, Ready, Session};
use crate::plan::{Cut, Layout};
use crate::{Device, VulkanError, module, words};

/// An artefact on a device.
pub struct Shader<'d> {
    device: &'d Device,
    manifest: Manifest,
    layout: Layout,
    cut: Cut,
    ready: Ready,
    // What is used goes before what it uses.
    _pipeline: Owned<vk::Pipeline>,
    _pipeline_layout: Owned<vk::PipelineLayout>,
    /// Owns the set.
    _pool: Owned<vk::DescriptorPool>,
    _set_layout: Owned<vk::DescriptorSetLayout>,
}

impl<'d> Shader<'d> {
    pub(crate) fn new(device: &'d Device, bytes: &[u8], manifest: &Manifest) -> Result<Self, VulkanError> {
        let core = device.core();
        let layout = Layout::new(manifest)?;
        let cut = layout.cut(&core.info, &core.limits, device.settings())?;
        let doubles = layout.precision == isograd_compiler::Precision::F64;
        let code = module::words(bytes, &layout.entry, layout.workgroup, doubles)?;
        let entry = CString::new(layout.entry.as_str()).unwrap_or_default();
        let (set_layout, pool, set) = describe(core, &layout)?;
        let (pipeline_layout, pipeline) = build(core, &code, &entry, set_layout.handle)?;
        let ready = Ready { pipeline: pipeline.handle, layout: pipeline_layout.handle, set };
        Ok(Self {
            device,
            manifest: manifest.clone(),
            layout,
            cut,
            ready,
            _pipeline: pipeline,
            _pipeline_layout: pipeline_layout,
            _pool: pool,
            _set_layout: set_layout,
        })
    }

    /// How to call it.
    #[must_use]
    pub const fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Evaluates `points` points. `inputs` has one entry per input scalar of the manifest, all ports in order: one
    /// number per point if it varies, or a single one. Returns one column per output scalar, in order.
    ///
    /// # Errors
    /// If the inputs do not fit the manifest, memory is short, or the device fails.
    pub fn evaluate(&self, inputs: &[Values<'_>], points: usize) -> Result<Vec<Column>, VulkanError> {
        self.evaluate_timed(inputs, points).map(|(columns, _)| columns)
    }

    /// As [`Shader::evaluate`], with the nanoseconds that the kernel ran by the device's clock, without the copies to and
    /// from its memory; `None` if it has no clock. The first run may include the translation to the device's
    /// instructions.
    ///
    /// # Errors
    /// As [`Shader::evaluate`].
    pub fn evaluate_timed(
        &self,
        inputs: &[Values<'_>],
        points: usize,
    ) -> Result<(Vec<Column>, Option<f64>), VulkanError> {
        fits(&self.manifest, inputs, points)?;
        let empty = |place: &crate::plan::Place| words::empty(place.scalar, self.layout.precision, points);
        let mut columns = self.layout.outputs.iter().map(empty).collect::<Result<Vec<_>, _>>()?;
        if points == 0 || columns.is_empty() {
            return Ok((columns, None));
        }
        let time = self.device.with_session(|session| self.run(session, inputs, points, &mut columns))?;
        Ok((columns, time))
    }

    /// Evaluates chunk by chunk.
    fn run(
        &self,
        session: &mut Session,
        inputs: &[Values<'_>],
        points: usize,
        columns: &mut [Column],
    ) -> Result<Option<f64>, VulkanError> {
        let largest = u32::try_from(points).map_or(self.cut.chunk, |points| points.min(self.cut.chunk));
        let bytes = self.bytes(largest);
        session.reserve(bytes)?;
        self.bind(session, bytes);
        let [_, uniforms, _] = bytes;
        session.uniforms.with(uniforms, |buffer| self.fill(Rate::Uniform, inputs, 0, 1, buffer))?;
        let mut time = Some(0.0);
        for from in (0..points).step_by(largest as usize) {
            let count = u32::try_from(points - from).map_or(largest, |rest| rest.min(largest));
            let bytes = self.bytes(count);
            let [read, _, written] = bytes;
            session.inputs.with(read, |buffer| self.fill(Rate::Varying, inputs, from, count as usize, buffer))?;
            let chunk = Chunk { count, dispatch: self.cut.dispatch, workgroup: self.layout.workgroup, bytes };
            let took = session.run(&self.ready, &chunk)?;
            time = time.zip(took).map(|(all, one)| all + one);
            session.outputs.with(written, |buffer| self.take(columns, count as usize, buffer))?;
        }
        Ok(time)
    }

    /// Bytes of the inputs, the uniform inputs and the outputs of a chunk.
    fn bytes(&self, points: u32) -> [u64; 3] {
        [
            self.layout.bytes(self.layout.columns(Rate::Varying), points),
            self.layout.bytes(self.layout.columns(Rate::Uniform), 1),
            self.layout.bytes(self.layout.outputs.len(), points),
        ]
    }

    /// Fills a buffer with the input columns of a rate.
    fn fill(&self, rate: Rate, inputs: &[Values<'_>], from: usize, count: usize, buffer: &mut [u8]) {
        let columns = self.layout.inputs.iter().zip(inputs).filter(|((_, r), _)| *r == rate);
        for ((place, _), values) in columns {
            if let Some(column) = buffer.get_mut(self.range(place.column, count)) {
                words::put(*values, self.layout.precision, from, column);
            }
        }
    }

    /// Appends the outputs of a chunk to their columns.
    fn take(&self, columns: &mut [Column], count: usize, buffer: &[u8]) {
        for (place, column) in self.layout.outputs.iter().zip(columns) {
            words::take(column, self.layout.precision, buffer.get(self.range(place.column, count)).unwrap_or(&[]));
        }
    }

    /// The bytes of a column of a buffer with so many elements per column.
    const fn range(&self, column: u32, count: usize) -> std::ops::Range<usize> {
        let size = count * self.layout.element() as usize;
        column as usize * size..(column as usize + 1) * size
    }

    /// Names the session's buffers to the kernel. They may have changed since it last ran.
    fn bind(&self, session: &Session, bytes: [u64; 3]) {
        let [inputs, uniforms, outputs, call] = session.buffers();
        let [read, once, written] = bytes;
        let bindings = &self.layout.bindings;
        let all = [
            (bindings.inputs, DescriptorType::STORAGE_BUFFER, inputs, read),
            (bindings.uniforms, DescriptorType::STORAGE_BUFFER, uniforms, once),
            (Some(bindings.outputs), DescriptorType::STORAGE_BUFFER, outputs, written),
            (Some(bindings.call), DescriptorType::UNIFORM_BUFFER_DYNAMIC, call, CALL_BYTES),
        ];
        let infos = all.map(|(_, _, buffer, range)| [vk::DescriptorBufferInfo { buffer, offset: 0, range }]);
        let writes: Vec<_> = all
            .iter()
            .zip(&infos)
            .filter_map(|((binding, ty, ..), info)| binding.map(|binding| (binding, *ty, info)))
            .map(|(binding, ty, info)| {
                vk::WriteDescriptorSet::default()
                    .dst_set(self.ready.set)
                    .dst_binding(binding)
                    .descriptor_type(ty)
                    .buffer_info(info)
            })
            .collect();
        // SAFETY: the set has these bindings, of these kinds, and no device uses it: whoever has the session is the only
        // one to run a kernel. Each buffer has at least this range.
        unsafe { self.device.core().raw.update_descriptor_sets(&writes, &[]) };
    }
}

type Described = (Owned<vk::DescriptorSetLayout>, Owned<vk::DescriptorPool>, vk::DescriptorSet);

/// Makes the one descriptor set of a kernel, with the bindings that it has.
fn describe(core: &Arc<Core>, layout: &Layout) -> Result<Described, VulkanError> {
    let made = VulkanError::call("describing the kernel's buffers");
    let of = &layout.bindings;
    let storage = [of.inputs, of.uniforms, Some(of.outputs)].into_iter().flatten();
    let bindings: Vec<_> = storage
        .map(|binding| (binding, DescriptorType::STORAGE_BUFFER))
        .chain([(of.call, DescriptorType::UNIFORM_BUFFER_DYNAMIC)])
        .map(|(binding, ty)| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(binding)
                .descriptor_type(ty)
                .descriptor_count(1)
                .stage_flags(vk::ShaderStageFlags::COMPUTE)
        })
        .collect();
    let sizes = [(DescriptorType::STORAGE_BUFFER, 3), (DescriptorType::UNIFORM_BUFFER_DYNAMIC, 1)]
        .map(|(ty, count)| vk::DescriptorPoolSize { ty, descriptor_count: count });
    let create = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
    let pool = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
    // SAFETY: no two bindings have one number, as `Layout` saw to; the pool has room for the set. What is made goes to an
    // owner at once, with the call that destroys its kind; the set is its pool's.
    unsafe {
        let set_layout = core.raw.create_descriptor_set_layout(&create, None).map_err(&made)?;
        let set_layout =
            Owned::new(core, set_layout, |device, layout| device.destroy_descriptor_set_layout(layout, None));
        let pool = core.raw.create_descriptor_pool(&pool, None).map_err(&made)?;
        let pool = Owned::new(core, pool, |device, pool| device.destroy_descriptor_pool(pool, None));
        let layouts = [set_layout.handle];
        let sets = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool.handle).set_layouts(&layouts);
        let sets = core.raw.allocate_descriptor_sets(&sets).map_err(&made)?;
        Ok((set_layout, pool, sets.into_iter().next().unwrap_or_default()))
    }
}

/// Has the driver translate a kernel.
fn build(
    core: &Arc<Core>,
    code: &[u32],
    entry: &std::ffi::CStr,
    set: vk::DescriptorSetLayout,
) -> Result<(Owned<vk::PipelineLayout>, Owned<vk::Pipeline>), VulkanError> {
    let refused = VulkanError::call("translating the kernel");
    let sets = [set];
    let layout = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets);
    let module = vk::ShaderModuleCreateInfo::default().code(code);
    // SAFETY: the words are a module of the compiler's, whose entry point is there, as `module` saw to; the layout has its
    // bindings. What is made goes to an owner at once, with the call that destroys its kind.
    unsafe {
        let layout = core.raw.create_pipeline_layout(&layout, None).map_err(&refused)?;
        let layout = Owned::new(core, layout, |device, layout| device.destroy_pipeline_layout(layout, None));
        let module = core.raw.create_shader_module(&module, None).map_err(&refused)?;
        let module = Owned::new(core, module, |device, module| device.destroy_shader_module(module, None));
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module.handle)
            .name(entry);
        let create = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout.handle)];
        let pipelines = core.raw.create_compute_pipelines(vk::PipelineCache::null(), &create, None);
        let pipeline = pipelines.map_err(|(_, result)| refused(result))?.into_iter().next().unwrap_or_default();
        let pipeline = Owned::new(core, pipeline, |device, pipeline| device.destroy_pipeline(pipeline, None));
        Ok((layout, pipeline))
    }
}
