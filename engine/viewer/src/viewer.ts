// The module that is loaded: by the service's page when it is wanted, by a page of its own at once.

export {openSplats} from "./splats.js";
import {standalone} from "./standalone.js";

const scene = document.getElementById("scene");
if (scene?.getAttribute("type") === "application/octet-stream") void standalone(scene);
