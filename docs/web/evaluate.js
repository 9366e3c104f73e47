// Evaluates a WebAssembly module that Isograd emitted, in a browser or in Node, with nothing but its bytes. Knows the
// contract of a module, docs/targets.md; knows nothing of fields and of pictures.

/**
 * Makes a module ready.
 *
 * @param {BufferSource} bytes the module
 * @returns {Promise<{manifest: object, evaluate: function}>} its manifest and `evaluate`
 */
export async function load(bytes) {
    const module = await WebAssembly.compile(bytes);
    const [section] = WebAssembly.Module.customSections(module, "isograd.manifest");
    if (!section) throw new Error("the module has no section `isograd.manifest`: Isograd did not emit it");
    const manifest = JSON.parse(new TextDecoder().decode(section));
    const { exports } = await WebAssembly.instantiate(module); // It imports nothing.
    const { block, pad } = manifest;

    // Reals are f32 or f64 by the precision; ints and truth values are i32, truth values 0 or 1. All is little-endian,
    // as typed arrays are on every machine with a browser; offsets are multiples of 16. The memory never grows.
    const real = manifest.precision === "f64" ? Float64Array : Float32Array;
    const kind = (column) => (column.scalar === "real" ? real : Int32Array);
    const view = (column, length) => new (kind(column))(exports.memory.buffer, column.offset, length);

    /**
     * Evaluates any number of points.
     *
     * @param {Object<string, number | ArrayLike<number>>} inputs by the names of columns:
     *     `{"at.x": [0, 1], "at.y": [0, 1], "radius": 2}`. A varying column takes one number for each point or a single
     *     one for all, a uniform column a single one. What has a default may be left out.
     * @returns {Object<string, Object<string, TypedArray>>} outputs by query and column:
     *     `outputs["gradient(at)"]["at.x"]`, one number for each point
     */
    function evaluate(inputs) {
        const columns = manifest.inputs.flatMap(({ rate, columns }) =>
            columns.map((column) => {
                const given = inputs[column.name] ?? number(column.default);
                if (given === undefined) throw new Error(`the input \`${column.name}\` is not given`);
                const values = kind(column).from(typeof given === "object" ? given : [given]);
                return { ...column, varying: rate === "varying", values };
            }),
        );
        const points = Math.max(1, ...columns.map(({ varying, values }) => (varying ? values.length : 1)));
        for (const { name, varying, values } of columns) {
            if (values.length !== 1 && !(varying && values.length === points)) {
                const wanted = varying && points > 1 ? `1 or ${points}` : "1";
                throw new Error(`the input \`${name}\` has ${values.length} numbers; it must have ${wanted}`);
            }
        }
        const outputs = {};
        for (const port of manifest.outputs) {
            outputs[port.name] = Object.fromEntries(port.columns.map((c) => [c.name, new (kind(c))(points)]));
        }

        for (let first = 0; first < points; first += block) {
            const count = Math.min(block, points - first);
            // The module works on `pad` points at once: the last point is repeated to fill the last of these groups.
            const padded = Math.ceil(count / pad) * pad;
            for (const column of columns) {
                if (column.values.length === 1) {
                    view(column, column.varying ? padded : 1).fill(column.values[0]);
                } else {
                    const place = view(column, padded);
                    place.set(column.values.subarray(first, first + count));
                    place.fill(column.values[first + count - 1], count);
                }
            }
            exports.eval(count);
            for (const port of manifest.outputs) {
                for (const column of port.columns) outputs[port.name][column.name].set(view(column, count), first);
            }
        }
        return outputs;
    }

    return { manifest, evaluate };
}

/** A number of a manifest: JSON has no infinities, they are written as text. */
function number(value) {
    return value === "inf" ? Infinity : value === "-inf" ? -Infinity : value;
}
