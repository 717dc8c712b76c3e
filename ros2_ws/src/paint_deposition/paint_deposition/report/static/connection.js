// The socket to the server, which reconnects by itself, and its messages.

const KINDS = { float32: Float32Array, uint32: Uint32Array, uint16: Uint16Array, uint8: Uint8Array };
const FIRST_PAUSE_MS = 500;
const LONGEST_PAUSE_MS = 4000;
const SILENCE_MS = 4000; // the server says something every second

// A 16-bit float as a number, by its bits.
const HALF = Float32Array.from({ length: 65536 }, (_, bits) => {
  const exponent = (bits >> 10) & 31;
  const fraction = bits & 1023;
  const size = exponent === 31 ? (fraction ? NaN : Infinity)
    : exponent ? (1 + fraction / 1024) * 2 ** (exponent - 15) : fraction * 2 ** -24;
  return bits >> 15 ? -size : size;
});

// A message: the length of its head, the head as JSON, the arrays that the head lists.
export function decode(buffer) {
  let at = 4 + new DataView(buffer).getUint32(0, true);
  const message = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, at - 4)));
  for (const [name, type, count] of message.arrays) {
    const end = at + count * KINDS[type].BYTES_PER_ELEMENT;
    message[name] = new KINDS[type](buffer.slice(at, end));
    at = end;
  }
  return message;
}

// Put the changed values of a film into the one that is there: a bit for each vertex, and the
// values of those whose bit is set.
export function applyFilm(film, { changed, um }) {
  let next = 0;
  for (let byte = 0; byte < changed.length; byte++) {
    for (let bits = changed[byte], vertex = 8 * byte; bits; bits >>= 1, vertex++) {
      if (bits & 1) film[vertex] = HALF[um[next++]];
    }
  }
}

// Call `receive` with every message and `tell` with whether the server is heard; gives a function
// that sends a word.
export function connect(receive, tell) {
  let socket;
  let pause = FIRST_PAUSE_MS;
  let heard = Infinity;
  const open = () => {
    const scheme = location.protocol === 'https:' ? 'wss' : 'ws';
    socket = new WebSocket(`${scheme}://${location.host}/scene`);
    socket.binaryType = 'arraybuffer';
    socket.onmessage = (event) => {
      pause = FIRST_PAUSE_MS;
      heard = Date.now();
      tell(true);
      receive(decode(event.data));
    };
    socket.onclose = () => {
      heard = Infinity;
      tell(false);
      setTimeout(open, pause);
      pause = Math.min(2 * pause, LONGEST_PAUSE_MS);
    };
  };
  const send = (word) => socket.readyState === WebSocket.OPEN && socket.send(word);
  open();
  setInterval(() => {
    if (Date.now() - heard < SILENCE_MS) return;
    tell(false);
    send('alive?'); // to a server that is gone, it makes the browser close the socket
  }, 1000);
  return send;
}
