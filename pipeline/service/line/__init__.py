"""The factory's ports: TCP, MQTT, webhooks and OPC UA."""
