// Runs the page's script on a page that is not there, up to where it needs a real one, and prints what its
// pure functions answer to the questions on standard input: [[name, argument, ...], ...] as JSON.
import {readFileSync} from 'node:fs';

const content = {sensors: ['rgb', 'evt'], start_ms: 500, tracks: []};
const element = {textContent: JSON.stringify(content), namespaceURI: ''};
globalThis.document = {getElementById: () => element, querySelectorAll: () => []};
const names = ['last', 'at', 'ticks', 'label', 'range', 'number', 'seconds', 'twice', 'shape', 'panels'];
const source = readFileSync(process.argv[2], 'utf8');
const before = "pick.addEventListener('change'";
if (!source.includes(before)) throw new Error('the script no longer listens to the list of tracks');
const reached = source.slice(0, source.indexOf(before)) + `return {${names}};\n})()`;
const pure = (0, eval)(reached);
const questions = JSON.parse(readFileSync(0, 'utf8'));
console.log(JSON.stringify(questions.map(([name, ...args]) => pure[name](...args))));
