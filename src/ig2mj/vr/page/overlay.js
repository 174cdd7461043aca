// The goal, written on a small board that follows the head (0.7 m wide, 0.8 m ahead), and in the panel.
import * as THREE from "three";

export class Overlay {
  constructor(camera) {
    this.canvas = document.createElement("canvas");
    this.canvas.width = 1024;
    this.canvas.height = 256;
    this.texture = new THREE.CanvasTexture(this.canvas);
    this.texture.colorSpace = THREE.SRGBColorSpace;
    const look = new THREE.MeshBasicMaterial({map: this.texture, transparent: true, depthTest: false});
    this.board = new THREE.Mesh(new THREE.PlaneGeometry(0.7, 0.175), look);
    this.board.position.set(0, 0.22, -0.8);
    this.board.renderOrder = 10;
    camera.add(this.board);
    this.last = "";
    this.wanted = true;
  }

  toggle() { this.wanted = !this.wanted; }

  show(task, looks) {
    const text = JSON.stringify([task, looks.goal, looks.holds, looks.attached, Math.floor(looks.seconds)]);
    if (text === this.last) return;
    this.last = text;
    const draw = this.canvas.getContext("2d"), {width, height} = this.canvas;
    draw.clearRect(0, 0, width, height);
    draw.fillStyle = "rgba(16, 20, 26, 0.72)";
    draw.beginPath();
    draw.roundRect(0, 0, width, height, 24);
    draw.fill();
    draw.font = "600 44px system-ui, sans-serif";
    draw.fillStyle = looks.holds ? "#8be28b" : "#ffffff";
    const time = `${Math.floor(looks.seconds / 60)}:${String(Math.floor(looks.seconds % 60)).padStart(2, "0")}`;
    draw.fillText(`${task}  ${time}${looks.holds ? "  done" : ""}${looks.attached ? "" : "  (let go: hold both grips)"}`, 28, 60);
    draw.font = "38px ui-monospace, monospace";
    looks.goal.slice(0, 4).forEach(([literal, holds], k) => {
      draw.fillStyle = holds ? "#8be28b" : "#ffb3a5";
      draw.fillText(`${holds ? "\u2713" : "\u2717"} ${literal}`, 28, 116 + 46 * k, width - 56);
    });
    this.texture.needsUpdate = true;
    const list = document.getElementById("goal");
    list.replaceChildren(...looks.goal.map(([literal, holds]) => {
      const line = document.createElement("li");
      line.textContent = literal;
      line.classList.toggle("holds", holds);
      return line;
    }));
  }
}
