// Reads a session with Foxglove's own libraries, seeking and streaming, and decodes every message of it.
//
//   npm install @mcap/core @mcap/support @foxglove/rosmsg @foxglove/rosmsg2-serialization    # in any folder
//   node read_with_mcap_core.mjs run.mcap                                                    # from that folder

import { readFileSync } from "node:fs";
import { open } from "node:fs/promises";
import { createRequire } from "node:module";
import { join } from "node:path";

const require = createRequire(join(process.cwd(), "/"));
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");
const { loadDecompressHandlers } = require("@mcap/support");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");

class Readable {
  constructor(file) {
    this.file = file;
  }
  async size() {
    return BigInt((await this.file.stat()).size);
  }
  async read(offset, length) {
    const buffer = new Uint8Array(Number(length));
    await this.file.read(buffer, 0, Number(length), Number(offset));
    return buffer;
  }
}

function decoders(schemas) {
  const readers = new Map();
  return (schemaId, data) => {
    if (!readers.has(schemaId)) {
      const text = new TextDecoder().decode(schemas.get(schemaId).data);
      readers.set(schemaId, new MessageReader(parse(text, { ros2: true })));
    }
    return readers.get(schemaId).readMessage(data);
  };
}

async function seeking(path, decompressHandlers) {
  const file = await open(path);
  const reader = await McapIndexedReader.Initialize({ readable: new Readable(file), decompressHandlers });
  const decode = decoders(reader.schemasById);
  const counts = {};
  let last;
  for await (const message of reader.readMessages()) {
    const channel = reader.channelsById.get(message.channelId);
    const decoded = decode(channel.schemaId, message.data);
    counts[channel.topic] = (counts[channel.topic] ?? 0) + 1;
    if (channel.topic.endsWith("/status")) last = decoded;
  }
  let found = 0;
  const half = (reader.statistics.messageStartTime + reader.statistics.messageEndTime) / 2n;
  for await (const _ of reader.readMessages({ startTime: half })) found++;
  await file.close();
  return { profile: reader.header.profile, counts, fromHalfTime: found, digest: last?.digest?.toString() };
}

function streaming(path, decompressHandlers) {
  const reader = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  reader.append(readFileSync(path));
  const [schemas, channels, counts] = [new Map(), new Map(), {}];
  const decode = decoders(schemas);
  for (let record; (record = reader.nextRecord()); ) {
    if (record.type === "Schema") schemas.set(record.id, record);
    else if (record.type === "Channel") channels.set(record.id, record);
    else if (record.type === "Message") {
      const channel = channels.get(record.channelId);
      decode(channel.schemaId, record.data);
      counts[channel.topic] = (counts[channel.topic] ?? 0) + 1;
    }
  }
  return { done: reader.done(), counts };
}

const handlers = await loadDecompressHandlers();
const path = process.argv[2];
console.log(JSON.stringify({ seeking: await seeking(path, handlers), streaming: streaming(path, handlers) }, null, 2));
