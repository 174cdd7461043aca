// The page of `ig2mj vr`: a home in a headset, or in a window with mouse and keyboard.
//
// Pictures are drawn at the display's own rate from the newest poses; nothing here waits for the server.
import * as THREE from "three";
import {Desktop, pulse, readHeadset} from "./devices.js";
import {HOME_FROM_XR, Home} from "./home.js";
import {Overlay} from "./overlay.js";

const element = (id) => document.getElementById(id);
const renderer = new THREE.WebGLRenderer({antialias: true});
renderer.xr.enabled = true;
renderer.xr.setReferenceSpaceType("local-floor");
renderer.setPixelRatio(devicePixelRatio);
renderer.setSize(innerWidth, innerHeight);
document.body.append(renderer.domElement);
const scene = new THREE.Scene();
scene.background = new THREE.Color(0xd9e2ea);
scene.add(new THREE.HemisphereLight(0xffffff, 0xb9b0a4, 1.9));
const sun = new THREE.DirectionalLight(0xfff4e6, 1.6);
sun.position.set(1.5, 4, 2);
scene.add(sun);
const camera = new THREE.PerspectiveCamera(75, innerWidth / innerHeight, 0.05, 60);
camera.position.set(0, 1.6, 0);
scene.add(camera);
const overlay = new Overlay(camera);
const desktop = new Desktop(renderer.domElement);

let home = null, welcome = null, waiting = [], pads = [null, null], pressed = false;
const count = {pictures: 0, slowest: 0, since: performance.now(), last: performance.now()};
// For tests and for the curious: what this page is doing.
const state = window.ig2mj = {poses: 0, pictures: 0, pulses: [], looks: null, views: 0, rate: 0, ready: false, closed: false, renderer};

const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/`);
socket.binaryType = "arraybuffer";
const say = (message) => { if (socket.readyState === WebSocket.OPEN && socket.bufferedAmount < 65536) socket.send(JSON.stringify(message)); };

socket.onmessage = async ({data}) => {
  if (data instanceof ArrayBuffer) {
    const message = new Float32Array(data);
    if (!state.ready) waiting.push(message);
    else show(message);
    return;
  }
  const message = JSON.parse(data);
  if (message.type === "welcome") await begin(message);
  else if (message.type === "pulse") {
    pulse(pads[message.hand], message.strength, message.ms);
    state.pulses.push([message.hand, message.strength]);
    if (state.pulses.length > 1000) state.pulses.shift();
  } else if (message.type === "looks" && state.ready) {
    state.looks = message;
    home.looks(message);
    overlay.show(welcome.task, message);
    element("timing").textContent = Object.entries(message.timing).map(([part, ms]) => `${part} ${ms} ms`).join("   ");
  }
};
socket.onclose = () => { state.closed = true; element("note").textContent = "The connection is closed. Reload the page to come back."; };

async function begin(message) {
  welcome = message;
  element("task").textContent = message.task;
  element("summary").textContent = message.summary;
  home = new Home(message);
  await home.load("scene.glb");
  scene.add(home.root);
  waiting.forEach(show);
  waiting = [];
  state.ready = true;
  const able = await navigator.xr?.isSessionSupported("immersive-vr").catch(() => false);
  const button = element("enter");
  button.textContent = able ? "Enter the home" : "No headset here: use mouse and keyboard";
  button.disabled = !able;
  element("keys").open = !able;
  if (!isSecureContext) element("note").textContent = "Headsets need HTTPS (--certificate), or this machine's own address.";
}

function show(message) {
  state.poses += 1;
  home.pose(message);
  if (home.ghosts.length && !home.ghosts[0].parent) home.ghosts.forEach((ghost) => scene.add(ghost));
  if (message[5] && !renderer.xr.isPresenting) look(message);
}

// The camera of a page without a headset stands where the server says that the head is.
function look(message) {
  const turn = new THREE.Matrix4().makeRotationFromQuaternion(new THREE.Quaternion(message[10], message[11], message[12], message[9]));
  const xr = HOME_FROM_XR.clone().invert().multiply(turn).multiply(HOME_FROM_XR);
  camera.quaternion.setFromRotationMatrix(xr);
  camera.position.set(message[6], message[7], message[8]).applyMatrix4(HOME_FROM_XR.clone().invert());
}

element("enter").onclick = async () => {
  const session = await navigator.xr.requestSession("immersive-vr", {requiredFeatures: ["local-floor"]});
  element("panel").hidden = true;
  session.addEventListener("end", () => { element("panel").hidden = false; });
  await renderer.xr.setSession(session);
};

let told = 0;
renderer.setAnimationLoop((time, frame) => {
  const now = performance.now(), took = now - count.last;
  count.last = now;
  count.pictures += 1;
  state.pictures += 1;
  count.slowest = Math.max(count.slowest, took);
  if (now - count.since > 1000) {
    state.rate = count.pictures * 1000 / (now - count.since);
    say({type: "rate", pictures: state.rate, slowest: count.slowest});
    Object.assign(count, {pictures: 0, slowest: 0, since: now});
  }
  overlay.board.visible = renderer.xr.isPresenting && overlay.wanted;
  if (frame) {
    const read = readHeadset(frame, renderer.xr.getReferenceSpace());
    say(read.message);
    pads = read.pads;
    const menu = read.message.hands.some((hand) => (hand.buttons ?? 0) & 0b110000);
    if (menu && !pressed) overlay.toggle();
    pressed = menu;
    read.grips.forEach((grip, k) => home?.showGhost(k, grip && new THREE.Matrix4().fromArray(grip)));
    state.views = renderer.xr.getCamera().cameras.length;
  } else if (state.ready && now - told > 15) {
    told = now;
    say(desktop.read());
  }
  home?.advance(took / 1000);
  renderer.render(scene, camera);
});

addEventListener("resize", () => {
  camera.aspect = innerWidth / innerHeight;
  camera.updateProjectionMatrix();
  renderer.setSize(innerWidth, innerHeight);
});
