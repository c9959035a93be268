// SPDX-License-Identifier: Apache-2.0
// Opens the socket to the server. A classic script, because modules run when the whole page is read: the server
// answers the first socket while they still load.
"use strict";

function openSocket() {
  const url = new URL("socket", location.href);
  url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
  const socket = new WebSocket(url);
  socket.binaryType = "arraybuffer";
  return socket;
}

const firstSocket = { socket: openSocket(), received: [], isClosed: false };
firstSocket.socket.onmessage = (event) => firstSocket.received.push(event.data);
firstSocket.socket.onclose = () => { firstSocket.isClosed = true; };
