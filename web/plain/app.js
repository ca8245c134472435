// SPDX-License-Identifier: Apache-2.0
// The session's state in a table, once a second, and the buttons.
"use strict";
const token = new URLSearchParams(location.hash.slice(1)).get("token") || "";
const headers = token ? { "X-Dkb-Token": token } : {};
let paused = false;

async function show() {
  const trouble = document.getElementById("trouble");
  try {
    const answer = await fetch("api/state", { headers });
    if (!answer.ok) throw new Error(answer.status === 401 ? "open the address that was printed, with its token" : answer.status);
    const state = await answer.json();
    paused = state.paused;
    document.getElementById("pause").textContent = paused ? "Resume" : "Pause";
    document.getElementById("state").replaceChildren(...Object.entries(state).map(([name, value]) => {
      const row = document.createElement("tr");
      for (const text of [name.replace("_", " "), value]) row.appendChild(document.createElement("td")).textContent = text;
      return row;
    }));
    trouble.textContent = "";
  } catch (error) {
    trouble.textContent = "no answer: " + error.message;
  }
}
function order(what) {
  fetch("api/command", { method: "POST", headers: { ...headers, "Content-Type": "application/json" }, body: JSON.stringify({ do: what }) }).then(show);
}
document.getElementById("pause").onclick = () => order(paused ? "resume" : "pause");
document.getElementById("step").onclick = () => order("step");
document.getElementById("save_map").onclick = () => order("save_map");
setInterval(show, 1000);
show();
