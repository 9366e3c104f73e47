// Runs WGSL kernels on the GPU by their sidecars alone, through Dawn:
//
//   node run.mjs JOBS.json [OPTION...]      options of the package `webgpu`: backend=vulkan, adapter=NAME
//
// JOBS.json is a list of {shader, manifest, points, varying, uniforms, output}: paths of the WGSL, of the manifest, and of
// raw little-endian elements, the columns of varying inputs one after the other and the uniform inputs; outputs are
// written as the inputs are read, columns of `points` elements. Prints one JSON object: the adapter, and for each job null
// or what is wrong. `WEBGPU_PACKAGE` is the folder of the package, if it is not where node finds it.
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';

const [, , list, ...options] = process.argv;
const folder = process.env.WEBGPU_PACKAGE;
const { create, globals } = await import(folder ? pathToFileURL(join(folder, 'index.js')).href : 'webgpu');
Object.assign(globalThis, globals);

// A device lives as long as this is reachable.
let gpu = create(options);
const adapter = await gpu.requestAdapter();
if (!adapter) throw new Error('Dawn finds no adapter');
const { maxStorageBufferBindingSize, maxBufferSize } = adapter.limits;
const device = await adapter.requestDevice({ requiredLimits: { maxStorageBufferBindingSize, maxBufferSize } });

const report = { adapter: adapter.info.description || adapter.info.device, results: [] };
for (const job of JSON.parse(readFileSync(list, 'utf8'))) {
  device.pushErrorScope('validation');
  let wrong = null;
  try {
    await run(job);
  } catch (error) {
    wrong = String(error.message ?? error);
  }
  const invalid = await device.popErrorScope();
  report.results.push(wrong ?? invalid?.message ?? null);
}
process.stdout.write(JSON.stringify(report));
device.destroy();
gpu = null;

async function run(job) {
  const code = readFileSync(job.shader, 'utf8');
  const manifest = JSON.parse(readFileSync(job.manifest, 'utf8'));
  const { entry, workgroup, element, bindings } = manifest;
  const count = job.points;
  const columns = manifest.outputs.reduce((sum, port) => sum + port.columns.length, 0);

  const module = device.createShaderModule({ code });
  const messages = (await module.getCompilationInfo()).messages.filter((m) => m.type === 'error');
  if (messages.length) throw new Error(messages.map((m) => `${m.lineNum}:${m.linePos}: ${m.message}`).join('; '));
  const pipeline = await device.createComputePipelineAsync({ layout: 'auto', compute: { module, entryPoint: entry } });

  const { STORAGE, UNIFORM, COPY_DST, COPY_SRC, MAP_READ } = GPUBufferUsage;
  const made = [];
  const buffer = (bytes, usage) => {
    const size = Math.max(16, bytes.byteLength);
    const fresh = device.createBuffer({ size, usage: usage | COPY_DST });
    if (bytes.byteLength) device.queue.writeBuffer(fresh, 0, bytes);
    made.push(fresh);
    return fresh;
  };
  const size = columns * count * element;
  const outputs = buffer(new Uint8Array(size), STORAGE | COPY_SRC);
  const back = device.createBuffer({ size: Math.max(16, size), usage: MAP_READ | COPY_DST });
  made.push(back);

  const entries = [{ binding: bindings.outputs, resource: { buffer: outputs } }];
  const add = (binding, resource) => entries.push({ binding, resource: { buffer: resource } });
  if (bindings.inputs !== undefined) add(bindings.inputs, buffer(readFileSync(job.varying), STORAGE));
  if (bindings.uniforms !== undefined) add(bindings.uniforms, buffer(readFileSync(job.uniforms), STORAGE));
  // count, input_stride, output_stride, base; more than one dispatch, so that `base` is tried.
  const half = Math.ceil(count / 2 / workgroup) * workgroup;
  for (const [base, groups] of [[0, half / workgroup], [half, Math.ceil(Math.max(0, count - half) / workgroup)]]) {
    if (!groups) continue;
    const call = { binding: bindings.call, resource: { buffer: buffer(new Uint32Array([count, count, count, base]), UNIFORM) } };
    const group = device.createBindGroup({ layout: pipeline.getBindGroupLayout(bindings.set), entries: [...entries, call] });
    const encoder = device.createCommandEncoder();
    const pass = encoder.beginComputePass();
    pass.setPipeline(pipeline);
    pass.setBindGroup(bindings.set, group);
    pass.dispatchWorkgroups(groups);
    pass.end();
    device.queue.submit([encoder.finish()]);
  }
  const encoder = device.createCommandEncoder();
  encoder.copyBufferToBuffer(outputs, 0, back, 0, Math.max(4, size));
  device.queue.submit([encoder.finish()]);
  await back.mapAsync(GPUMapMode.READ);
  writeFileSync(job.output, new Uint8Array(back.getMappedRange().slice(0, size)));
  back.unmap();
  for (const one of made) one.destroy();
}
