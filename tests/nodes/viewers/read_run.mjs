// Prints how many messages a run has of each topic, and the newest of each, as JSON.
import {readFile} from 'node:fs/promises';
import {parse} from '@foxglove/rosmsg';
import {MessageReader} from '@foxglove/rosmsg2-serialization';
import * as zstd from '@foxglove/wasm-zstd';
import {McapIndexedReader} from '@mcap/core';

await zstd.isLoaded;
const bytes = await readFile(process.argv[2]);
const run = await McapIndexedReader.Initialize({
    readable: {
        size: async () => BigInt(bytes.length),
        read: async (offset, length) => bytes.subarray(Number(offset), Number(offset + length)),
    },
    decompressHandlers: {zstd: (chunk, size) => zstd.decompress(chunk, Number(size))},
});
const topics = {};
for await (const {channelId, data} of run.readMessages()) {
    const {topic, schemaId, metadata} = run.channelsById.get(channelId);
    const definition = new TextDecoder().decode(run.schemasById.get(schemaId).data);
    const found = (topics[topic] ??= {
        count: 0,
        qos: metadata.get('offered_qos_profiles'),
        reader: new MessageReader(parse(definition, {ros2: true})),
    });
    found.count += 1;
    found.newest = found.reader.readMessage(data);
}
const plain = (_, value) =>
    ArrayBuffer.isView(value) ? Array.from(value) : typeof value === 'bigint' ? String(value) : value;
console.log(JSON.stringify(topics, plain));
